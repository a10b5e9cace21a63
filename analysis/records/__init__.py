"""What is written: the records of a flight, of a pool or comparison, and of a fleet."""
