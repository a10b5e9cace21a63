"""Endurance, range, climb, ceiling and battery power, computed from a drag polar and the power train."""
