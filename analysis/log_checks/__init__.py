"""Refuses logs that other software wrote wrongly: messages, clock, units, axes. Each module judges one of these."""
