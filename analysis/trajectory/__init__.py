"""Trajectory reconstruction (flight-path reconstruction): attitude, velocity, wind, and the systematic sensor errors.

`reconstruction` runs the iteration. `problem` turns a flight into the inputs of the `equations`: `block_means` of all
channels, `inertial` sensors, `process` noise, `measurements` and weights, `regressors` of the sensor errors, `priors`
and the first estimate. `smoother` is one Gauss-Newton step. `gusts` finds the gusts' intensity and scale length.
`consistency` and `observability` report what a reconstructed flight shows about its sensors.

Vocabulary. Instants are the centers of n blocks of five samples. Tables have one row per instant, with index t_s.

Frames: earth axes north, east, down; body axes x forward, y right, z down. phi, theta, psi: bank (right wing down),
pitch (nose up) and heading (from north over east) [rad]. alpha and beta: positive with the wind from below and from the
right [rad]. p, q, r: rates [rad/s]. ax, ay, az: specific force [m/s^2], (0, 0, -g) in level flight.

States (`equations.STATES`): phi, theta, psi; v_north, v_east, v_down, the inertial velocity [m/s]; height above the
ground [m]; wind_north, wind_east, the slow wind, positive when it blows toward north and east [m/s]; gust_u, gust_v,
gust_w, the rest of the air's motion along the body axes [m/s], and two filter states of gusts. Air moves at wind + gust
over the ground.

The slow wind is horizontal, a random walk in time, and grows with height by the logarithmic profile
(`dryden.mean_wind_profile`). Gusts have Dryden's spectra (`process`). A mean updraft is not a state: it is estimated
with the sensor errors, and the interval of drag includes it (`updraft`, `analysis.methods.consider`).

Sensor errors (`equations.SENSOR_ERRORS`) are constant over the flight; a positive one makes the sensor read high, or
late. "Prior" is what is known about them before the flight, as 1 sigma.

Airspeeds [m/s]. All speeds are true airspeeds at the center of gravity:

    V_mps           column of the air data: measured by the probe, with its errors and all gusts
    V               at a state, by `equations.flow`: inertial velocity less wind and gusts, without errors
    without gusts   at a state, inertial velocity less wind (`process.airspeed_without_gusts`): speed at which the
                    aircraft passes through the gusts
    V_mean          regressor of the airspeed scale: airspeed without gusts; its instrument is its mean over the flight
    V_predicted     airspeed without gusts, extrapolated from the seconds before, so independent of the current gust;
                    used in quotients and flow angles
    measured V      V_mps, extrapolated likewise and corrected for the scale; used for the lift coefficient
    V_reference     V_mps smoothed over a second; used for noise in m/s and radians, and for the first estimate
"""
