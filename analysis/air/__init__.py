"""From raw channels to speed, flow angles and density at the center of gravity.

`flight_data` processes a log: it synchronizes channels, removes the lags of `lines` and the zeros at rest, and moves
the specific force to the center of gravity; `air` computes the air data with the map of the `probe`. Results of
calibrations are applied here; `analysis.calibrations` measures them.

Vocabulary. The table has one row per sample, with index t_s [s] from the beginning of the log, and NaN where nothing
was measured.
Body axes: x forward, y right, z down, origin at the center of gravity.

    q_c_Pa                  pressure of the center port less static pressure, zero at rest subtracted
    dp_alpha_Pa, dp_beta_Pa pressure differences of the two pairs of side ports; positive as alpha and beta are
    static_Pa               static pressure; height_m above the ground where the log began, by the standard lapse rate
    qbar_Pa, rho, V_mps     dynamic pressure, density [kg/m^3] and true airspeed
    alpha_rad, beta_rad     angles of attack and sideslip at the center of gravity, positive with the wind from below
                            and from the right; corrected for upwash and for the probe's velocity due to rotation
    p, q, r _radps          angular rates; ax, ay, az _mps2: specific force, (0, 0, -g) in level flight
    bank_rad                positive with the right wing down
    n_revps, J              speed of the motor [1/s] and advance ratio V/(n D)
    thrust_N, shaft_power_W from the propeller table; propeller_covered: whether J and rev/min lie in it
    flying                  dynamic pressure of flight, and flow angles within the probe's calibration
    speed_scale             of the aircraft (`flight.runs.AIRCRAFT_SIZE`), the same in all rows
"""
