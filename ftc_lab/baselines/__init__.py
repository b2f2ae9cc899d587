"""Baselines: periodic senders that are as good as a triggered one."""
