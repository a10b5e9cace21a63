"""Endurance, range, climb, ceiling and battery power: what follows from a drag polar and the power train."""
