"""Drag polars from flight data: one file a method, and the comparison of the methods."""
