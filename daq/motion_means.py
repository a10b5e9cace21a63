"""Computes speed, height, bank and forces of the aircraft from means of the readings, for `daq.run_monitor`."""

import math
from collections import deque
from typing import NamedTuple

from flightpower.daq.thrust import ThrustTable
from flightpower.daq.tick_means import MEAN_OVER_NS, Means
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.probe_maps import ProbeMaps
from flightpower.flight.runs import LEVEL_RUN, STANDING, flying_Pa, speed_scale
from flightpower.flight.units import GAS_CONSTANT_AIR, GRAVITY_MPS2, LAPSE_RATE

STEP_S = MEAN_OVER_NS / 1e9
HEIGHT_EXPONENT = GAS_CONSTANT_AIR * LAPSE_RATE / GRAVITY_MPS2
REST_ROWS = 5  # rows in a second, within which means at rest differ by less than the allowed spread
GROUND_S = 2.0
PLAUSIBLE = 0.5, 1.2  # bounds of static pressure divided by the ground's
ZEROED = ("q_c_Pa", "dp_alpha_Pa", "dp_beta_Pa", "p_radps", "q_radps", "r_radps")
STEADY = {
    **dict.fromkeys(("p_radps", "q_radps", "r_radps"), STANDING.rate_spread_radps),
    **dict.fromkeys(("ax_mps2", "ay_mps2", "az_mps2"), STANDING.force_spread_mps2),
    "q_c_Pa": STANDING.airspeed_spread_Pa,
}


class Motion(NamedTuple):
    """The motion during one interval of means. drag: thrust/m [m/s^2], q S/m [m/s^2], C_L, J; None if unknown."""

    t_s: float
    V: float
    height_m: float
    bank: float
    complete: bool
    drag: tuple[float, float, float, float] | None


class MotionFromMeans:
    """Takes zeros and ground pressure from the standing aircraft, and then computes the motion while it flies."""

    def __init__(
        self, aircraft: Aircraft, probe: ProbeMaps | None, thrust: ThrustTable | None, zeros: dict[str, float]
    ):
        self._probe, self._thrust = probe, thrust
        self._mass_kg, self._area_m2 = aircraft.mass_kg, aircraft.geometry.wing_area_m2
        self.scale = speed_scale(aircraft.mass.weight_N, self._area_m2)
        self._flying_Pa = flying_Pa(self.scale)
        self._zeros = dict.fromkeys(ZEROED, 0.0) | zeros
        self._recent: deque[Means] = deque(maxlen=REST_ROWS)
        self._rest_rows = 0
        self._ground: list[tuple[float, float]] = []  # pressures and temperatures on the ground
        self._flown = False
        self._bank: float | None = None
        self._v: float | None = None  # lateral speed

    @property
    def ground_known(self) -> bool:
        """Whether means of the standing aircraft were received."""
        return self._rest_rows > 0

    def at(self, means: Means) -> Motion | None:
        """Return the motion; None on the ground, or without pressures."""
        motion = self._in_flight(means)
        if motion is None:
            self._bank = self._v = None
        return motion

    def _in_flight(self, means: Means) -> Motion | None:
        ground = means.static_Pa, means.static_temperature_K
        if (means.t_s < GROUND_S or not self._ground) and ground[0] is not None and ground[1] is not None:
            self._ground.append((ground[0], ground[1]))
        if not self._flown:
            self._take_zeros(means)
        if means.q_c_Pa is None or means.static_Pa is None or not self._ground:
            return None
        ground_Pa, ground_K = (sum(values) / len(self._ground) for values in zip(*self._ground, strict=True))
        if not PLAUSIBLE[0] < means.static_Pa / ground_Pa < PLAUSIBLE[1]:
            return None
        q_c = means.q_c_Pa - self._zeros["q_c_Pa"]
        if q_c <= self._flying_Pa / 2:
            return None
        alpha, beta, qbar = self._flow(means, q_c)
        if qbar <= self._flying_Pa:
            return None
        self._flown = True
        height_m = ground_K / LAPSE_RATE * (1 - (means.static_Pa / ground_Pa) ** HEIGHT_EXPONENT)
        rho = means.static_Pa / (GAS_CONSTANT_AIR * (ground_K - LAPSE_RATE * height_m))
        V = math.sqrt(2 * qbar / rho)
        bank = self._banked(means, V, alpha, beta)
        complete = None not in (means.ax_mps2, means.az_mps2, means.q_radps) and means.dp_alpha_Pa is not None
        return Motion(means.t_s, V, height_m, bank, complete, self._drag(means, V, alpha, qbar, rho))

    def _take_zeros(self, means: Means) -> None:
        """Average the oldest of the latest means into the zeros if the aircraft stood still throughout all of these."""
        self._recent.append(means)
        if len(self._recent) < REST_ROWS or any((m.n_revps or 0.0) > STANDING.motor_revps for m in self._recent):
            return
        for name, spread in STEADY.items():
            values = [value for m in self._recent if (value := getattr(m, name)) is not None]
            if values and max(values) - min(values) > spread:
                return
        self._rest_rows += 1
        for name in ZEROED:
            value = getattr(self._recent[0], name)
            if value is not None:
                before = self._zeros[name] if self._rest_rows > 1 else value
                self._zeros[name] = before + (value - before) / self._rest_rows

    def _flow(self, means: Means, q_c: float) -> tuple[float, float, float]:
        """Angles of attack and sideslip, and dynamic pressure; the angles are zero without a calibration."""
        if self._probe is None or means.dp_alpha_Pa is None:
            return 0.0, 0.0, q_c
        dp_alpha = means.dp_alpha_Pa - self._zeros["dp_alpha_Pa"]
        dp_beta = 0.0 if means.dp_beta_Pa is None else means.dp_beta_Pa - self._zeros["dp_beta_Pa"]
        flow = self._probe.flow(dp_alpha / q_c, dp_beta / q_c)
        return flow.alpha_rad, flow.beta_rad, q_c / flow.q_ratio

    def _banked(self, means: Means, V: float, alpha: float, beta: float) -> float:
        """Bank angle from the lateral balance of forces (3.7) and the roll rate, as in analysis.air.air."""
        if means.ay_mps2 is None or means.p_radps is None or means.r_radps is None:
            return self._bank or 0.0
        p, r = means.p_radps - self._zeros["p_radps"], means.r_radps - self._zeros["r_radps"]
        v = V * math.sin(beta)
        vdot = 0.0 if self._v is None else (v - self._v) / STEP_S
        self._v = v
        balance = (vdot - p * V * math.sin(alpha) + r * V * math.cos(alpha) - means.ay_mps2) / GRAVITY_MPS2
        slow = math.asin(min(max(balance, -1.0), 1.0))
        keep = math.exp(-STEP_S / LEVEL_RUN.bank_time_constant_s)
        self._bank = slow if self._bank is None else keep * (self._bank + p * STEP_S) + (1 - keep) * slow
        return self._bank

    def _drag(
        self, means: Means, V: float, alpha: float, qbar: float, rho: float
    ) -> tuple[float, float, float, float] | None:
        """The quantities that the energy balance needs (`Motion.drag`); None without thrust or load factor."""
        n = means.n_revps
        if self._thrust is None or n is None or n <= STANDING.motor_revps or means.az_mps2 is None:
            return None
        thrust_over_m = self._thrust.thrust_N(V, n, rho) * math.cos(alpha) / self._mass_kg
        qS_over_m = qbar * self._area_m2 / self._mass_kg
        return thrust_over_m, qS_over_m, -means.az_mps2 / qS_over_m, V / (n * self._thrust.diameter_m)
