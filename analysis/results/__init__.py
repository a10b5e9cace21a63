"""Converts estimates to the documented form of `results.json` (docs/use/results.md)."""
