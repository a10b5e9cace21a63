"""Thresholds and priors of the electrical power curve of an ordinary flight."""

from dataclasses import dataclass
from typing import NamedTuple

from flightpower.flight.settings import Settings, setting


class Normal(NamedTuple):
    """A normal prior."""

    mean: float
    sigma: float


@dataclass(frozen=True)
class PitotZero(Settings):
    """Settings for the zero of the pitot's pressure, which comes from the time on the ground."""

    block_s: float = setting(10.0, "s", "longer than gusts on the ground")
    near_s: float = setting(300.0, "s", "from the flight: a transducer drifts with its temperature")
    sigma_Pa: float = setting(0.7, "Pa", "drift between ground and flight, of common transducers")
    unknown_sigma_Pa: float = setting(3.0, "Pa", "what an autopilot's own zero before the flight leaves")


ZERO = PitotZero()


@dataclass(frozen=True)
class AirTemperature(Settings):
    """Limits for a thermometer to show the air, and uncertainties of air temperature."""

    coldest_K: float = setting(233.0, "K", "-40 °C: batteries do not fly below")
    hottest_K: float = setting(323.0, "K", "50 °C: no air near the ground is hotter")
    warm_K: float = setting(303.0, "K", "a thermometer above this is probably inside the electronics")
    given_sigma_K: float = setting(2.0, "K", "of what a user measures on the ground for a flight")
    sigma_K: float = setting(3.0, "K", "of a sensor outside the electronics")
    unknown_sigma_K: float = setting(8.0, "K", "without a believable thermometer: 3 % of density")


TEMPERATURE = AirTemperature()


@dataclass(frozen=True)
class AirspeedByGps(Settings):
    """Priors and limits for scale and zero of the airspeed, and for the wind."""

    scale_sigma: float = setting(0.0125, "1", "of an airspeed sensor and its place, before the flight")
    trend_mps2: float = setting(0.01, "m/s²", "of the wind: 6 m/s in ten minutes are rare")
    wind_sigma_mps: float = setting(10.0, "m/s", "the strongest wind in which small aircraft are flown")
    latency_s: float = setting(0.15, "s", "of GPS velocity, of common receivers")
    correlation_s: tuple[float, ...] = setting((2.0, 5.0, 10.0, 20.0, 40.0), "s", "candidates; the likeliest is taken")
    white_share: float = setting(0.05, "1", "of the residuals' variance, by GPS noise")
    known_wind: float = setting(0.1, "1", "share of the slowest airspeed: a less certain wind changes power by 30 %")
    airspeed_change_mps: float = setting(
        3.0, "m/s", "between the headings of two legs, for a first estimate of wind without a pitot"
    )
    roughness_m: float = setting(0.05, "m", "of grass and crops (MIL-F-8785C: 0.15 ft)")
    most_points: int = setting(500, "1", "a matrix of this size is inverted several times")


GPS = AirspeedByGps()


@dataclass(frozen=True)
class DragAndEfficiencyPrior(Settings):
    """Priors that cover the variety of small electric aircraft. The means of ln and logit parameters are medians."""

    CD0: Normal = setting(Normal(0.05, 0.6), "1, ln", "from clean sailplanes to trainers with gear")
    oswald: Normal = setting(Normal(0.75, 0.25), "1, ln", "of small straight wings with fuselage")
    CL_of_least_drag: Normal = setting(Normal(0.2, 0.2), "1", "of symmetric to cambered airfoils")
    K4: Normal = setting(Normal(0.01, 0.015), "1", "drag near the stall")
    efficiency: Normal = setting(Normal(0.6, 0.4), "1, logit", "battery to thrust: 0.5 to 0.7")
    x_sigma: float = setting(0.3, "ln", "of the advance of best efficiency about the one mostly flown")
    fall: Normal = setting(Normal(0.7, 0.5), "1, ln", "of efficiency beyond its maximum, by tables of propellers")
    law_evidence: float = setting(
        60.0, "-2 ln", "for the power law, which no propeller follows exactly; wind alone gives 20"
    )
    law_efficiency: Normal = setting(Normal(0.5, 1.0), "1, ln", "of the power law: the current meter may also be wrong")
    law_speed: Normal = setting(Normal(0.3, 0.5), "1", "exponent of speed: 0 of a jet to 1, where thrust does not fall")
    law_power: Normal = setting(Normal(-0.1, 0.2), "1", "exponent of power: -1/3 of an ideal propeller at rest to 0")
    idle_drag: Normal = setting(Normal(0.1, 0.15), "C_D0", "of an idling propeller")
    alpha_0_sigma: float = setting(0.1, "rad", "includes the mounting of the accelerometer")
    alpha_per_CL_sigma: float = setting(0.3, "ln", "about the slope of a straight wing (Helmbold)")
    beta_per_CY: Normal = setting(
        Normal(1.7, 0.5), "rad, ln", "sideslip over side force coefficient, of fin and fuselage"
    )
    alpha_per_CT_sigma: float = setting(0.2, "rad", "by the propeller's wash over the wing")
    rise_exponent: float = setting(2.3, "1", "of efficiency over advance: fits APC 10x5E and 12x8E within 0.02")


PRIOR = DragAndEfficiencyPrior()


@dataclass(frozen=True)
class BalanceWindows(Settings):
    """Windows of the energy balance."""

    length_s: float = setting(8.0, "s", "shorter ones contain only gusts, longer ones average maneuvers away")
    most: int = setting(400, "1", "a matrix of twice this size is inverted several times")

    @property
    def times_s(self) -> tuple[float, ...]:
        """Candidates for correlation times, from an eighth to twice a window's length. Noise with much shorter times is
        averaged away, and noise with much longer times looks constant.
        """
        return tuple(self.length_s * 2.0**i for i in range(-3, 2))


WINDOWS = BalanceWindows()


@dataclass(frozen=True)
class Residuals(Settings):
    """Settings for the balance's residuals: motion of the air, shape of the efficiency curve, angle of attack."""

    efficiency_share: Normal = setting(Normal(0.05, 0.35), "1, ln", "error of the efficiency's form; estimated, too")
    efficiency_s: float = setting(10.0, "s", "how long it lasts: a maneuver")
    white_W: float = setting(1.0, "W", "of a window's power, uncorrelated: resolution of current and height")
    gust_length_m: Normal = setting(Normal(60.0, 0.7), "m, ln", "the height above ground (MIL-F-8785C)")
    first_s: float = setting(3.0, "s", "with which the search begins")
    first_gust_mps: float = setting(0.3, "m/s", "with which the search begins")
    first_angle_rad: float = setting(0.005, "rad", "with which the search begins")


RESIDUALS = Residuals()


@dataclass(frozen=True)
class ErrorsOfTheFlight(Settings):
    """Standard deviations of errors that a whole flight shares."""

    current: float = setting(0.0115, "1", "of a current meter: evenly within 2 %")
    mass: float = setting(0.005, "1", "of a weighed aircraft")
    idle_power_W: float = setting(1.0, "W", "of the power drawn with the motor off, where the log shows it")
    unseen_idle_W: float = setting(5.0, "W", "of avionics where it does not; as uncertain as itself")
    least_updraft_mps: float = setting(0.01, "m/s", "mean of a flight, of calm air over warm ground")
    updraft_share: float = setting(0.08, "1", "of the size of vertical air motion; for electrical power")
    updraft_share_for_drag: float = setting(
        0.2, "1", "the same for drag, which in strong turbulence is found 1 to 2 % too low"
    )
    motor_constants: float = setting(0.04, "1", "of electrical power, where motor speed follows from it")


SHARED = ErrorsOfTheFlight()


@dataclass(frozen=True)
class Curve(Settings):
    """Speeds at which power is reported."""

    percentiles: tuple[float, float] = setting(
        (5.0, 98.0), "%", "percentiles of the windows' airspeed: speeds held, not just passed through"
    )
    aspect_ratio: tuple[float, float] = setting(
        (0.5, 60.0), "1", "outside this range span and area are swapped or mistyped"
    )


CURVE = Curve()


@dataclass(frozen=True)
class ThrustByTable(Settings):
    """Conditions under which thrust from the propeller table can be used."""

    greatest_J: float = setting(1.5, "1", "of the correction of the table: beyond, no table was measured")
    least_power: float = setting(0.1, "1", "of the 95th percentile, from which motor speed follows from power")
    motor_efficiency: tuple[float, float] = setting(
        (0.45, 1.02), "1", "shaft power by the table over electrical power; no motor has more"
    )


THRUST = ThrustByTable()


@dataclass(frozen=True)
class CoarserComputation(Settings):
    """Coarser computation of the whole flight of a complete log, which should cost little compared with the rest."""

    every: int = setting(3, "1", "sample of the flight's table")

    @property
    def most_windows(self) -> int:
        return WINDOWS.most // 4


COARSER = CoarserComputation()
