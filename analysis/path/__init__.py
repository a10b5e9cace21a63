"""The flight path: what attitude, velocity and wind the aircraft really had, and what its sensors really erred.

`batch` solves, `model` knows the equations, `reconstruct` knows the data.
"""
