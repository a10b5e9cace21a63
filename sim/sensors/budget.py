"""Error budgets, which state the size of each error. `draw` draws the errors of one flight from a budget.

Shipped: `none`, `bench` (noise of Table 4.1, small residual errors; the default), `study` (the budget of the method's
study, systematic errors drawn at random by the seed) and `harsh` (`study` with the errors that the study left out).
"""

import tomllib
from dataclasses import asdict, dataclass, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.files import read_text
from flightpower.flight.units import read_table
from flightpower.sim.defects import NO_DEFECTS, Defects
from flightpower.sim.drag_shape import DragShape
from flightpower.sim.plant import Deviations
from flightpower.sim.sensors.noise import rng_of


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Standard deviations of the noise, for 25 Hz data unless stated otherwise."""

    accel_mps2: float = 0.0
    gyro_radps: float = 0.0
    alpha_Pa: float = 0.0
    beta_Pa: float = 0.0
    airspeed_Pa: float = 0.0
    static_Pa: float = 0.0
    baro_Pa: float = 0.0
    colored_Pa: float = 0.0  # added to the differential transducers, with the correlation time `colored_time`
    colored_time_s: float = 0.5
    magnetic_T: float = 0.0
    gps_position_m: float = 0.0  # correlated over `gps_correlation`
    gps_velocity_mps: float = 0.0  # half of it correlated, half white
    gps_correlation_s: float = 60.0
    motor_speed_revps: float = 0.0
    attitude_rad: float = 0.0
    battery_voltage_V: float = 0.0
    battery_current_A: float = 0.0
    vibration_mps2: float = 0.0  # in cruise, not random: amplitude at motor speed; half as much at twice that


@dataclass(frozen=True, kw_only=True)
class Systematic:
    """Errors that are constant over a flight: standard deviations of normal distributions, or half widths of uniform
    ones where the budget says `evenly`; `lag` and latency are uniform between zero and the value."""

    alpha_offset_rad: float = 0.0
    beta_offset_rad: float = 0.0
    alpha_scale: float = 0.0
    beta_scale: float = 0.0
    V_scale: float = 0.0  # scale error of the airspeed from the center port
    static_position: float = 0.0  # error of the static line, as a fraction of dynamic pressure
    lag_s: float = 0.0  # longest lag added to every pneumatic line
    zero_Pa: float = 0.0  # zero of the differential transducers at power-on
    zero_drift_Pa: float = 0.0  # change of the zero after warming up by 10 K
    zero_cooling_Pa: float = 0.0  # change of the zero by the temperature gradient that the airstream causes in flight
    zero_step_Pa: float = 0.0  # step of the zero in mid-flight
    hysteresis: float = 0.0  # hysteresis of the differential transducers, as a fraction of the last swing
    absolute_Pa: float = 0.0  # error of the two absolute transducers
    accel_bias_mps2: float = 0.0
    accel_scale: float = 0.0
    imu_misalignment_rad: float = 0.0  # misalignment about each axis
    gyro_bias_radps: float = 0.0
    gyro_scale: float = 0.0
    hard_iron_T: float = 0.0
    soft_iron: float = 0.0
    gps_latency_s: float = 0.0  # longest
    motor_speed_scale: float = 0.0
    attitude_rad: float = 0.0
    battery_scale: float = 0.0
    # Differences from the aircraft file and the propeller's table.
    thrust_scale: float = 0.0
    thrust_slope_J: float = 0.0
    thrust_bow: float = 0.0
    windmilling: float = 0.0
    weight_scale: float = 0.0
    updraft_mps: float = 0.0
    CD_quartic: float = 0.0
    CD_bucket: float = 0.0
    reynolds_exponent: float = 0.0
    # GPS has no fix from the time `gps_lost` on, for the duration `gps_lost_for`.
    gps_lost_s: float = 0.0
    gps_lost_for_s: float = 0.0


@dataclass(frozen=True, kw_only=True)
class ErrorBudget:
    title: str = ""
    evenly: bool = False  # systematic errors are uniform within plus and minus their size, not normal
    noise: Noise = Noise()
    systematic: Systematic = Systematic()
    defects: Defects = NO_DEFECTS


@dataclass(frozen=True)
class DrawnErrors:
    """The errors of one flight. Vectors are per axis or per line; `values` has the drawn scalars of `Systematic`."""

    seed: int
    noise: Noise
    values: Systematic
    defects: Defects
    accel_bias: Array
    accel_scale: Array
    gyro_bias: Array
    gyro_scale: Array
    imu_rotation: Array  # (3, 3), from body axes to sensor axes
    box_rotation: Array  # (3, 3), the same for the whole box, due to a defect
    hard_iron: Array
    soft_iron: Array  # (3, 3)
    zero: dict[str, float]
    zero_drift: dict[str, float]
    zero_cooling: dict[str, float]
    zero_step: dict[str, float]
    zero_step_at: float  # time of the step as a fraction of the flight
    absolute: dict[str, float]
    installation_seed: int  # seed of the errors that belong to the installation

    def as_dict(self) -> dict[str, Any]:
        """Return the errors as plain numbers and lists, for the truth file."""
        return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in asdict(self).items()}

    @property
    def board(self) -> tuple[int, int, int]:
        """The serial number of the processor of this installation's autopilot, 96 bits in three words."""
        first, second, third = rng_of(self.installation_seed, "autopilot").integers(2**32, size=3).tolist()
        return first, second, third

    @property
    def deviations(self) -> Deviations:
        v = self.values
        return Deviations(
            thrust_scale=v.thrust_scale,
            thrust_slope_J=v.thrust_slope_J,
            weight_scale=v.weight_scale,
            updraft_mps=v.updraft_mps + self.defects.updraft_mps,
            thrust_bow=v.thrust_bow,
            windmilling=v.windmilling,
            gear_CD=self.defects.gear_CD,
            thrust_loss=self.defects.thrust_loss,
            battery_sag=self.defects.battery_sag,
            drag=DragShape(quartic=abs(v.CD_quartic), bucket=v.CD_bucket, reynolds_exponent=v.reynolds_exponent),
        )


FROM_ZERO = ("lag_s", "gps_latency_s")
AS_GIVEN = ("hysteresis", "gps_lost_s", "gps_lost_for_s", "windmilling", "CD_bucket", "reynolds_exponent")
DIFFERENTIAL = ("alpha", "beta", "airspeed")


def draw(budget: ErrorBudget, seed: int) -> DrawnErrors:
    """Draw the errors of one flight, a pure function of budget and seed; each error has its own random stream."""
    s = budget.systematic

    def of_size_one(name: str, n: int) -> Array:
        rng = rng_of(seed, f"systematic {name}")
        return rng.uniform(-1.0, 1.0, n) if budget.evenly else rng.standard_normal(n)

    values = {}
    for field in fields(Systematic):
        size = getattr(s, field.name)
        if field.name in AS_GIVEN:
            values[field.name] = size
        elif field.name in FROM_ZERO:
            values[field.name] = size * float(rng_of(seed, f"systematic {field.name}").uniform())
        else:
            values[field.name] = size * float(of_size_one(field.name, 1)[0])
    skew = of_size_one("soft iron matrix", 9).reshape(3, 3)
    zeros, drifts = of_size_one("zeros", 3) * s.zero_Pa, of_size_one("zero drifts", 3) * s.zero_drift_Pa
    coolings = of_size_one("zero coolings", 3) * s.zero_cooling_Pa
    steps = of_size_one("zero steps", 3) * s.zero_step_Pa
    absolute = of_size_one("absolute", 2) * s.absolute_Pa
    return DrawnErrors(
        seed=seed,
        installation_seed=seed,
        noise=budget.noise,
        values=Systematic(**values),
        defects=budget.defects,
        accel_bias=s.accel_bias_mps2 * of_size_one("accel bias", 3),
        accel_scale=s.accel_scale * of_size_one("accel scale", 3),
        gyro_bias=s.gyro_bias_radps * of_size_one("gyro bias", 3),
        gyro_scale=s.gyro_scale * of_size_one("gyro scale", 3),
        imu_rotation=_rotation(s.imu_misalignment_rad * of_size_one("imu misalignment", 3)),
        box_rotation=_rotation(np.array(budget.defects.imu_turn_rad)),
        hard_iron=s.hard_iron_T * of_size_one("hard iron", 3),
        soft_iron=np.eye(3) + s.soft_iron * (skew + skew.T) / 2,
        zero=dict(zip(DIFFERENTIAL, zeros.tolist(), strict=True)),
        zero_drift=dict(zip(DIFFERENTIAL, drifts.tolist(), strict=True)),
        zero_cooling=dict(zip(DIFFERENTIAL, coolings.tolist(), strict=True)),
        zero_step=dict(zip(DIFFERENTIAL, steps.tolist(), strict=True)),
        zero_step_at=float(rng_of(seed, "zero step time").uniform(0.3, 0.8)),
        absolute=dict(zip(("baro", "static"), absolute.tolist(), strict=True)),
    )


def of_installation(day: DrawnErrors, installation: DrawnErrors) -> DrawnErrors:
    """The errors of one flight of an installation: IMU biases, transducer zeros and updraft are those of the day; all
    other errors, of probe, tubes, mounting, propeller and aircraft, stay the same from flight to flight."""
    return replace(
        day,
        values=replace(installation.values, updraft_mps=day.values.updraft_mps),
        installation_seed=installation.installation_seed,
        imu_rotation=installation.imu_rotation,
        accel_scale=installation.accel_scale,
        gyro_scale=installation.gyro_scale,
        hard_iron=installation.hard_iron,
        soft_iron=installation.soft_iron,
    )


def _rotation(vector: Array) -> Array:
    """The matrix (3, 3) from unrotated axes to axes rotated by a rotation vector (Rodrigues)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vector).as_matrix().T)


def shipped_budgets() -> list[str]:
    folder = resources.files("flightpower.sim") / "data" / "errors"
    return sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))


def load_budget(name_or_path: str | Path) -> ErrorBudget:
    """A budget shipped with the package, by name, or one from a file.

    Raises InputError, which names file and key, if the budget is missing or malformed, or has a wrong unit.
    """
    shipped = resources.files("flightpower.sim") / "data" / "errors" / f"{name_or_path}.toml"
    path = Path(name_or_path)
    if path.suffix == "" and shipped.is_file():
        text = shipped.read_text("utf-8")
    elif path.is_file():
        text = read_text(path)
    else:
        raise InputError(f"errors {name_or_path}: neither a file nor one of {', '.join(shipped_budgets())}")
    try:
        table: dict[str, Any] = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"errors {name_or_path}: not valid TOML ({error})") from None
    budget = read_table(ErrorBudget, table, f"errors {name_or_path}")
    for section in (budget.noise, budget.systematic):
        for name, value in asdict(section).items():
            if value < 0:
                raise InputError(f"errors {name_or_path}: {name} is negative; give the size of the error")
    return budget
