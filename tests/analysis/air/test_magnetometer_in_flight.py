"""The strength of its field shows whether a calibrated magnetometer can be trusted in flight."""

import msgspec
import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.air.magnetometer import MAGNETOMETER_FILE, MagnetometerCalibration, compass
from flightpower.flight.errors import InputError
from flightpower.flight.motion import body_from_earth

FIELD_T, DIP_RAD, NOISE_T = 48.5e-6, np.radians(63.0), 0.5e-6
LEVEL_T = FIELD_T * np.cos(DIP_RAD)
CALIBRATION = MagnetometerCalibration(
    source="log", samples=1500, hard_iron_T=(4e-6, -3e-6, 2e-6), hard_iron_error_T=(1e-7, 1e-7, 1e-7),
    soft_iron=((1.02, 0.01, 0.0), (0.01, 0.99, 0.02), (0.0, 0.02, 0.99)), soft_iron_error=0.002, field_T=FIELD_T,
    residual_before_T=3e-6, residual_T=5e-7, directions=0.5,
)  # fmt: skip


def flight(left_T=(0.0, 0.0, 0.0), left_on_the_ground_T: float = 0.0) -> pd.DataFrame:
    """A minute of standing, then four minutes of turns; field of leftover iron in flight, and of a car on the ground
    [T]."""
    t = np.arange(0, 300, 0.04)
    flying = t > 60
    phi, theta, psi = (
        np.where(flying, 0.3 * np.sin(t / 9), 0.0),
        0.1 * np.sin(t / 7),
        np.where(flying, (t - 60) / 12, 0),
    )
    true = np.column_stack(body_from_earth((LEVEL_T, 0.0, FIELD_T * np.sin(DIP_RAD)), (phi, theta, psi)))
    true += np.where(flying[:, None], left_T, left_on_the_ground_T)
    raw = true @ np.linalg.inv(np.array(CALIBRATION.soft_iron)).T + CALIBRATION.hard_iron_T
    raw += NOISE_T * np.random.default_rng(0).normal(size=raw.shape)
    columns = {f"mag_{axis}_T": raw[:, i] for i, axis in enumerate("xyz")}
    return pd.DataFrame(columns | {"flying": flying}, index=pd.Index(t, name="t_s"))


def test_the_field_is_without_iron_and_that_of_the_ground_is_left_out() -> None:
    table = flight(left_on_the_ground_T=20e-6)
    field, message = compass(table, CALIBRATION)
    flying = table["flying"].to_numpy()
    assert message == [] and np.isnan(field.field_T[~flying]).all()
    strength = np.linalg.norm(field.field_T[flying], axis=1)
    assert strength.mean() == pytest.approx(FIELD_T, rel=1e-3)
    assert np.degrees(field.error_T / LEVEL_T) == pytest.approx(3.0, abs=1.0), "deg of heading, from motor currents"


@pytest.mark.parametrize("left_uT", [2.0, 3.5])
def test_iron_that_was_left_over_is_seen_in_the_strength_and_the_error_grows_with_it(left_uT: float) -> None:
    """A level field of left_uT along the x axis turns the heading by left_uT/22 rad on east and west and not at all on
    north and south: the rms is that over sqrt(2)."""
    field, message = compass(flight(left_T=(1e-6 * left_uT, 0.0, 0.0)), CALIBRATION)
    assert message == []
    assert field.error_T > 1e-6 * left_uT / np.sqrt(2)
    assert field.error_T < 2e-6 * left_uT


def test_a_calibration_of_another_aircraft_is_noticed_and_nothing_of_it_used() -> None:
    across, along = flight(left_T=(15e-6, 0.0, 0.0)), flight(left_T=(0.0, 0.0, 15e-6))
    field, (message,) = compass(across, CALIBRATION)
    assert field is None and "not used" in message and "Calibrate it again" in message
    along_field = 15 * LEVEL_T / FIELD_T / np.sqrt(2)  # uT rms, of iron that turns with the aircraft in the field
    assert float(message.partition("varies by ")[2].split(" uT")[0]) == pytest.approx(along_field, rel=0.1)
    field, (message,) = compass(along, CALIBRATION)
    assert field is None and "not used" in message and "in flight is 62 uT, but 48 uT in its calibration" in message


def test_a_moments_iron_is_left_out_and_said() -> None:
    table = flight()
    table.loc[100.0:110.0, "mag_z_T"] += 10e-6
    field, (message,) = compass(table, CALIBRATION)
    assert np.isnan(field.field_T[(table.index > 100) & (table.index < 110)]).all()
    assert "left out for 4 % of the flight, where the field strength is more than 10 % off" in message
    assert field.error_T == pytest.approx(compass(flight(), CALIBRATION)[0].error_T, rel=0.05)


def test_one_that_is_silent_in_flight_is_said_to_be() -> None:
    table = flight()
    table.loc[table["flying"], "mag_x_T"] = np.nan
    for silent in (table, table[["flying"]]):
        field, (message,) = compass(silent, CALIBRATION)
        assert field is None and "too few samples in flight" in message


def test_a_calibration_is_read_as_it_was_written(tmp_path) -> None:
    (tmp_path / "magnetometer.json").write_bytes(msgspec.json.encode(CALIBRATION))
    assert MAGNETOMETER_FILE.load(tmp_path / "magnetometer.json") == CALIBRATION
    with pytest.raises(InputError, match=r"none\.json: cannot be read"):
        MAGNETOMETER_FILE.load(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({"format": "flightpower-probe-1"}, "format 'flightpower-probe-1' is not supported"),
        ({"hard_iron_T": [0.0, 0.0]}, "not a magnetometer calibration"),
        ({"soft_iron": [[1.0, 0.0, 0.0]]}, "soft_iron has 1 rows"),
        ({"field_T": 4.85e-3}, "a field of 4850 uT is nowhere on earth"),
    ],
)
def test_what_is_no_calibration_is_refused(change: dict, cause: str) -> None:
    content = msgspec.to_builtins(CALIBRATION) | change
    with pytest.raises(InputError, match=f"magnetometer.json: .*{cause}"):
        MAGNETOMETER_FILE.parsed(msgspec.json.encode(content), "magnetometer.json")
    with pytest.raises(InputError, match="not a magnetometer calibration"):
        MAGNETOMETER_FILE.parsed(b"{", "magnetometer.json")


@pytest.mark.parametrize(
    ("change", "more_T"),
    [
        ({"soft_iron_error": 0.05}, 0.05 * FIELD_T),
        ({"hard_iron_error_T": (1e-6, 2e-6, 2e-6)}, 3e-6),
    ],
)
def test_errors_of_the_calibration_are_part_of_the_compass_error(change: dict, more_T: float) -> None:
    exact = msgspec.structs.replace(CALIBRATION, soft_iron_error=0.0, hard_iron_error_T=(0.0, 0.0, 0.0))
    (precise, _), (vague, _) = (compass(flight(), c) for c in (exact, msgspec.structs.replace(exact, **change)))
    assert np.sqrt(vague.error_T**2 - precise.error_T**2) == pytest.approx(more_T, rel=1e-6)
