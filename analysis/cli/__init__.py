"""The commands `analyze` and `calibrate`: arguments, messages and exit codes; no computation."""
