"""Priors, limits and steps that the computation of performance uses and a flight does not determine."""

from dataclasses import dataclass

from flightpower.analysis.maneuvers.settings import LOADS, STEADY_POINT
from flightpower.flight.settings import Settings, setting


@dataclass(frozen=True)
class PowerTrain(Settings):
    """Losses between propeller shaft and battery, fitted to slow stretches of the flight."""

    shaft_scale_sigma: float = setting(0.05, "1", "two sources of one propeller differ by 10 % in power coefficient")
    loss_sigma_share: float = setting(
        0.5,
        "1",
        "of the losses, and of the loss of speed by torque: a motor's constants leave out the speed controller and half"
        " of the iron and bearing losses",
    )
    meter_scale_sigma: float = setting(
        0.02, "1", "current sensors are set up to a few percent, and nothing on board measures it better"
    )
    slow_per_s: float = setting(0.04, "1/s", "largest relative change of motor speed that counts as slow")

    @property
    def shortest_s(self) -> float:
        """Shorter slow stretches are left out; this is three windows of the moving average."""
        return 3 * LOADS.smoothing_s

    @property
    def needed_s(self) -> float:
        """Total time of slow flight required, which gives two points of efficiency; with less, losses are assumed."""
        return 2 * STEADY_POINT.smoothing_s


@dataclass(frozen=True)
class AssumedMotor(Settings):
    """The motor that is assumed if the aircraft file lacks its constants; the losses have wide priors in any case."""

    loss_share: float = setting(
        0.1, "1", "a motor that fits its propeller loses a tenth of the highest power each to friction and to copper"
    )
    unloaded_over_highest: float = setting(1.25, "1", "motor speed without load over the highest flown")
    inertia_over_diameter_5: float = setting(
        9e-5 / 0.305**5, "kg/m^3", "of a propeller of 12 in (0.305 m) with the motor's bell, 9e-5 kg m^2"
    )


@dataclass(frozen=True)
class FullThrottleFlown(Settings):
    """Limits for stretches of the flight to count as full throttle."""

    least: float = setting(0.97, "1", "of the stick's travel; less is not full throttle")
    settling_s: float = setting(0.6, "s", "after the stick moves: ramp of the speed controller, inertia of the motor")

    @property
    def needed_s(self) -> float:
        """Total time of settled full throttle required, two shortest stretches; with less, full throttle is unknown."""
        return 2 * self.shortest_s

    @property
    def shortest_s(self) -> float:
        """Shorter settled stretches are left out; this is one window of the moving average of motor speed."""
        return LOADS.smoothing_s


@dataclass(frozen=True)
class Performance(Settings):
    """Level flight, climb and ceilings."""

    fastest_sought: float = setting(1.35, "1", "highest level speed is sought to this times the fastest speed flown")


@dataclass(frozen=True)
class Asked(Settings):
    """Conditions that performance is computed for by default, and limits for the user's requests."""

    usable: float = setting(0.8, "1", "share of a battery's energy: common for lithium polymer")
    payload_kg: float = setting(0.3, "kg", "added once and twice to the weight flown")
    hotter_K: float = setting(15.0, "K", "added to the temperature flown")
    higher_m: float = setting(1000.0, "m", "added to the density altitude flown")
    heaviest_kg: float = setting(1000.0, "kg", "far above any small aircraft: a larger weight is a mistake of units")


POWER_TRAIN = PowerTrain()
ASSUMED_MOTOR = AssumedMotor()
FULL_THROTTLE = FullThrottleFlown()
PERFORMANCE = Performance()
ASKED = Asked()


@dataclass(frozen=True)
class ParameterSettings(Settings):
    """Limits for a value to be given to an autopilot."""

    widest_share: float = setting(
        0.4, "1", "half width of an interval over its value beyond which a value for an autopilot is withheld"
    )


PARAMETERS = ParameterSettings()
