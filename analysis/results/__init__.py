"""Estimates put into the documented form of `results.json` (docs/results.md)."""
