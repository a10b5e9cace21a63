"""Calibrations and measurements on the ground. Each file measures, judges and reports one, and has its command."""
