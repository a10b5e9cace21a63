"""Drag polars from flight data, one file per method, and the comparison of the methods.

forces -> causes -> method (regression) -> methods -> comparison -> ladder; `whole_flight` needs no runs.
"""
