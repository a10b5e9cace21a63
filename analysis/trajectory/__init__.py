"""Flight-path reconstruction: attitude, velocity, wind, and the systematic errors of the sensors.

`equations` are the equations of motion and of the sensors, `data` the measurements, `smoother` one Gauss-Newton step,
`reconstruction` the iteration.
"""
