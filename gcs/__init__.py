"""The hands and eyes: scenarios, launcher, ground-station client, command line, reports."""
