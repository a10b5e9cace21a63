"""The pitot tube of an autopilot, at the wing: it measures dynamic pressure, with the budget's airspeed errors."""

import numpy as np

from flightpower.flight.arrays import Array
from flightpower.sim.fly import Flight
from flightpower.sim.sensors.budget import DrawnErrors
from flightpower.sim.sensors.noise import white

ZERO_SIGMA_PA = 1.5  # error remaining after the autopilot's own calibration before the flight
NOISE_S = 0.04  # the noise in the budget applies to means over this time


class AutopilotPitot:
    def __init__(self, flight: Flight, errors: DrawnErrors):
        truth, self._errors = flight.truth, errors
        self._t_s = truth["time_s"].to_numpy(dtype=float)
        qbar = np.nan_to_num(truth["dynamic_pressure_Pa"].to_numpy(dtype=float))
        self._shown_Pa = qbar * (1 + errors.values.V_scale) ** 2
        self._air_K = truth["temperature_K"].to_numpy(dtype=float)
        self._zero_Pa = ZERO_SIGMA_PA * float(white(errors.seed, "pitot zero", np.zeros(1))[0])

    def pressure_Pa(self, t_s: Array, averaged_s: float) -> Array:
        """Differential pressure [Pa] (n,), averaged over `averaged_s` [s]."""
        noise = self._errors.noise.airspeed_Pa * np.sqrt(NOISE_S / max(averaged_s, NOISE_S))
        return np.asarray(
            np.interp(t_s, self._t_s, self._shown_Pa) + self._zero_Pa + noise * white(self._errors.seed, "pitot", t_s)
        )

    def air_K(self, t_s: Array) -> Array:
        return np.asarray(np.interp(t_s, self._t_s, self._air_K))


def indicated_airspeed(pressure_Pa: Array) -> Array:
    """Indicated airspeed [m/s]; negative where the pressure is."""
    return np.asarray(np.sign(pressure_Pa) * np.sqrt(2 * np.abs(pressure_Pa) / 1.225))
