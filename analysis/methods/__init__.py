"""Drag polars from flight data, with one file per method, and the comparison of the methods.

The modules build on each other: forces -> causes -> method (regression) -> methods -> comparison -> ladder. The package
`whole_flight` needs no runs.
"""
