"""Trajectory reconstruction (flight-path reconstruction): attitude, velocity, wind, and the systematic sensor errors.

`reconstruction` is the iteration. `problem` turns a flight into the inputs of the `equations`: `block_means` of all
channels, `inertial` sensors, `process` noise, `measurements` and weights, `regressors` of the sensor errors, `priors`
and the first estimate. `smoother` is one Gauss-Newton step. `gusts` finds their intensity and scale length.
`consistency` and `observability` say what a reconstructed flight shows of its sensors.

Vocabulary. Instants are the centers of n blocks of five samples. Tables have one row an instant, index t_s.

Frames: earth axes north, east, down; body axes x forward, y right, z down. phi, theta, psi: bank (right wing down),
pitch (nose up) and heading (from north over east) [rad]. alpha and beta: positive with the wind from below and from the
right [rad]. p, q, r: rates [rad/s]. ax, ay, az: specific force [m/s^2], (0, 0, -g) in level flight.

States (`equations.STATES`): phi, theta, psi; v_north, v_east, v_down, the inertial velocity [m/s]; height above the
ground [m]; wind_north, wind_east, where the air of the slow wind goes [m/s]; gust_u, gust_v, gust_w, the rest of
the air's motion along the body axes [m/s], and two filter states of gusts. Air moves at wind + gust over the ground.

The moving air: a slow wind, level, that is a random walk of the time and grows with height by the logarithmic profile
(`dryden.mean_wind_profile`); and gusts by Dryden's spectra (`process`). A mean updraft is no state: it is an error that
the interval of drag contains (`updraft`, `analysis.methods.consider`).

Sensor errors (`equations.SENSOR_ERRORS`) are constant over the flight; a positive one makes the sensor read high, or
late. "Prior" is what is known of them before the flight, 1 sigma.

Airspeeds [m/s]. All speeds are true airspeeds at the center of gravity:

    V_mps           column of the air data: measured by the probe, with its errors and all gusts
    V               at a state, by `equations.flow`: inertial velocity less wind and gusts, without errors
    without gusts   at a state, inertial velocity less wind (`process.airspeed_without_gusts`): speed at which the
                    aircraft passes through the gusts
    V_mean          regressor of the airspeed scale: that without gusts; its instrument is its mean over the flight
    V_predicted     that without gusts, extrapolated from the seconds before: independent of the current gust; in
                    quotients and flow angles
    measured V      V_mps, extrapolated likewise and corrected for the scale; for the lift coefficient
    V_reference     V_mps smoothed over a second; for noise in m/s and radians, and the first estimate
"""
