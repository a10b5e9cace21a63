"""Estimates put into the documented form of `results.json` (docs/use/results.md)."""
