"""The records that results files hold, for a flight, a pool, a comparison, or a fleet."""
