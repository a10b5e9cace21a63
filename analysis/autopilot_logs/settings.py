"""Thresholds of reading autopilots' logs."""

from dataclasses import dataclass

from flight.settings import Settings, setting

Limits = tuple[float, float, float]


@dataclass(frozen=True)
class Readable(Settings):
    """What a channel has to be. Limits: least and greatest possible, and greatest difference from a median of five."""

    fewest_samples: int = setting(20, "1", "a channel with fewer was switched off")
    clock_jump_s: float = setting(60.0, "s", "a longer step of the clock within one channel is no dropout")
    pitot_Pa: Limits = setting((-2000.0, 20_000.0, 600.0), "Pa", "to 180 m/s; a larger step is a damaged byte")
    static_Pa: Limits = setting((20_000.0, 120_000.0, 300.0), "Pa", "to 12 km; 25 m in one sample are a damaged byte")
    force_mps2: Limits = setting((-300.0, 300.0, 100.0), "m/s²", "30 g, beyond the range of common accelerometers")
    voltage_V: Limits = setting((0.0, 1000.0, 50.0), "V", "above any battery of a UAV")
    current_A: Limits = setting((-1000.0, 2000.0, 300.0), "A", "above any battery of a UAV")
    motor_revps: Limits = setting((0.0, 2000.0, 100.0), "rev/s", "120 000 rpm")
    ground_mps: Limits = setting((-300.0, 300.0, 30.0), "m/s", "of GPS velocity")
    temperature_K: Limits = setting((150.0, 450.0, 50.0), "K", "beyond it a sensor is broken")


READABLE = Readable()


@dataclass(frozen=True)
class Instances(Settings):
    """Which of several sensors measures."""

    turning_revps: float = setting(5.0, "rev/s", "a motor that stands shows less, by noise")
    second_pack: float = setting(0.5, "1", "of its power; one with more feeds the motor, too, or measures the same")
    second_battery: float = setting(0.1, "1", "of the used battery's power; a second one with more is mentioned")


INSTANCES = Instances()
