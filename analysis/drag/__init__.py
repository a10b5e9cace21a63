"""Drag polars from flight data, one file per method, and the comparison of the methods.

forces -> sensor_errors -> method_inputs -> method (regression) -> methods -> comparison -> estimate.
"""
