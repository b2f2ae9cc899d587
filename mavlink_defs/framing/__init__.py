"""Frames on the wire: the compiled codec, pymavlink frames, signatures."""
