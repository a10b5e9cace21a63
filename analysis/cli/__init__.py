"""The commands, such as `analyze`, `calibrate` and `export`: arguments, messages and exit codes; no computation."""
