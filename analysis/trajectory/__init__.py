"""Trajectory reconstruction (flight-path reconstruction): attitude, velocity, wind, and the systematic sensor errors.

`reconstruction` is the iteration. `problem` turns a flight into the inputs of the `equations`: `block_means` of all
channels, `inertial` sensors, `process` noise, `measurements` and weights, `regressors` of the sensor errors, `priors`,
`initial_estimate`. `smoother` is one Gauss-Newton step. `consistency`, `observability`, `time_shift` and
`airspeed_scale` say what a reconstructed flight shows of its sensors.
"""
