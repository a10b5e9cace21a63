"""The commands `analyze`, `calibrate`, `compare`, `export`, `plan`: arguments, messages, exit codes; no computation."""
