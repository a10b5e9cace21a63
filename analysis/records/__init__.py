"""The records that results files hold: those of a flight, of a pool or comparison, and of a fleet."""
