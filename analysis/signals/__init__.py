"""Log to synchronized channels, and where the aircraft stood still."""
