"""Calibrations and measurements on the ground, one file each: measure, judge, report, and the command."""
