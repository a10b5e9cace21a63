"""Magnetometer and surfaces: a calibration recovers the simulated values within the uncertainty that it states."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.analysis.air.settings import MAGNETOMETER
from flightpower.analysis.calibrations import magnetometer, surfaces
from flightpower.flight.errors import InputError
from flightpower.flight.motion import body_from_earth

FIELD_T, DIP_RAD, NOISE_T = 48.5e-6, np.radians(63.0), 0.5e-6


def measured(seed: int, *, by_hand: bool):
    """One draw of the field with iron (n, 3), its hard iron (3,), and the field without iron (n, 3) [T]."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 60, 1500)
    if by_hand:
        phi, theta, psi = np.pi * np.sin(t / 3.7), 1.3 * np.sin(t / 2.7 + 1), t / 1.75
    else:  # two steep turns, one each way
        phi, theta, psi = np.where(t < 30, 0.7, -0.7) * (1 + 0.1 * np.sin(t)), 0.05 + 0.03 * np.sin(t / 2), t / 2.4
    body = np.column_stack(
        body_from_earth((FIELD_T * np.cos(DIP_RAD), 0.0, FIELD_T * np.sin(DIP_RAD)), (phi, theta, psi))
    )
    skew = rng.normal(size=(3, 3))
    soft, hard = np.eye(3) + 0.05 * (skew + skew.T) / 2, 5e-6 * rng.normal(size=3)
    return body @ soft.T + hard + NOISE_T * rng.normal(size=body.shape), hard, body


def off_deg(field, true) -> float:
    """Rms angle between two fields."""
    cosine = np.sum(field * true, axis=1) / np.linalg.norm(field, axis=1) / np.linalg.norm(true, axis=1)
    return float(np.degrees(np.sqrt(np.mean(np.arccos(np.clip(cosine, -1, 1)) ** 2))))


@pytest.mark.parametrize("by_hand", [True, False], ids=["turned by hand", "two turns in flight"])
def test_hard_iron_lies_within_its_errors_and_the_field_points_where_it_should(by_hand: bool) -> None:
    """Over 10 draws; noise of 0.5 uT leaves a direction error of 0.5 sqrt(2)/48.5 rad, which is 0.84 deg."""
    for seed in range(10):
        field, hard, true = measured(seed, by_hand=by_hand)
        calibration = magnetometer.calibrate(field, "log")
        assert np.all(np.abs(np.array(calibration.hard_iron_T) - hard) < 4 * np.array(calibration.hard_iron_error_T))
        assert off_deg(calibration.corrected(field), true) < (0.95 if by_hand else 3.0)
        assert calibration.residual_T < 1.1 * NOISE_T < calibration.residual_before_T


def test_turns_alone_leave_the_vertical_part_open_and_say_so() -> None:
    by_hand, turns = (magnetometer.calibrate(measured(0, by_hand=way)[0], "log") for way in (True, False))
    assert turns.hard_iron_error_T[2] > 10 * by_hand.hard_iron_error_T[2]
    assert turns.hard_iron_error_T[2] > 3 * turns.hard_iron_error_T[0]
    assert turns.directions < 0.25 < by_hand.directions


def test_directions_are_those_of_the_field_without_iron() -> None:
    """`directions` is the standard deviation of the field's direction along its least varied axis: 1/sqrt(3) if all
    directions are equally frequent."""
    for by_hand in (True, False):
        field, _, true = measured(1, by_hand=by_hand)
        along = np.linalg.eigvalsh(np.cov((true / FIELD_T).T))
        directions = magnetometer.calibrate(field + 30e-6, "log").directions
        assert directions == pytest.approx(np.sqrt(along[0]), rel=0.1 if by_hand else 0.3)


def test_what_is_no_magnetic_field_is_refused() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="too few"):
        magnetometer.calibrate(rng.normal(size=(50, 3)), "log")
    with pytest.raises(InputError, match=r"field is 4[678]\d uT, which is nowhere on earth \(18 to 78\)"):
        magnetometer.calibrate(measured(0, by_hand=True)[0] * 10, "log")


PULSES, ANGLES = (1500.0, 1000.0, 1250.0, 1750.0, 2000.0), (0.0, -22.0, -11.2, 10.8, 21.0)


def session(pulses=PULSES, hold_s: float = 3.5, seed: int = 0):
    """A stick that moves from hold to hold within half a second and jitters by a microsecond."""
    rng = np.random.default_rng(seed)
    t, values = [0.0], [pulses[0]]
    for k, pulse in enumerate(pulses):
        for target, seconds in ((pulse, 0.5 if k else 0.0), (pulse, hold_s)):
            n = round(seconds * 25)
            values += np.linspace(values[-1], target, n + 1)[1:].tolist() if n else []
    t = np.arange(len(values)) / 25
    return t, np.array(values) + rng.integers(-1, 2, len(values))


def test_the_table_of_a_session_is_the_one_that_was_measured() -> None:
    holds = surfaces.held_pulses(*session())
    assert [round(hold.pulse_us, -1) for hold in holds] == list(PULSES)
    table = surfaces.surface_table(holds, ANGLES)
    assert table.pulse_us == pytest.approx(sorted(PULSES), abs=1)
    assert table.angle_deg == sorted(ANGLES)


def test_the_angle_may_fall_as_the_pulse_grows() -> None:
    table = surfaces.surface_table(surfaces.held_pulses(*session()), [-angle for angle in ANGLES])
    assert table.pulse_us == pytest.approx(sorted(PULSES), abs=1)
    assert table.angle_deg == sorted((-angle for angle in ANGLES), reverse=True)


def test_there_and_back_shows_the_play_of_the_linkage() -> None:
    there_and_back = (1500.0, 1000.0, 1500.0, 2000.0)
    table = surfaces.surface_table(surfaces.held_pulses(*session(there_and_back)), (0.0, -22.0, 1.0, 21.0))
    assert table.angle_deg == [-22.0, 0.5, 21.0]
    assert table.hysteresis_deg == 1.0


@pytest.mark.parametrize(("neighbor_deg", "is_clear"), [(5.0, True), (2.0, False)])
def test_the_smallest_step_has_to_stand_out_of_the_play(neighbor_deg: float, is_clear: bool) -> None:
    """With a play of 1.5 deg, two positions have to differ by 1.96 times that, however far away the others are."""
    holds = surfaces.held_pulses(*session((1500.0, 1000.0, 1500.0, 2000.0)))
    angles = (0.0, -22.0, 1.5, 0.75 + neighbor_deg)
    if is_clear:
        assert surfaces.surface_table(holds, angles).hysteresis_deg == 1.5
    else:
        with pytest.raises(InputError, match=r"neighboring positions only by 2\.0 deg"):
            surfaces.surface_table(holds, angles)


def test_the_section_is_one_that_an_aircraft_file_takes() -> None:
    from flightpower.flight.aircraft import load_aircraft, parse_aircraft

    table = surfaces.surface_table(surfaces.held_pulses(*session()), ANGLES)
    content = load_aircraft("nexstar").text
    head, rest = content.split("[elevator]")
    section = surfaces.to_toml("elevator", 2, table)
    aircraft = parse_aircraft(head + section + rest[rest.index("\n[aileron]") :], "mine.toml")
    assert aircraft.elevator.angle_of_pulse_rad(1250) == pytest.approx(np.radians(-11.2), abs=np.radians(0.1))


@pytest.mark.parametrize(
    ("angles", "cause"),
    [((0.0, -22.0), "2 angles for 5 positions"), ((0.0, -22.0, 30.0, 10.8, 21.0), "is the order right"),
     ((None, -22.0, None, None, None), "at least are needed")],
)  # fmt: skip
def test_angles_that_do_not_fit_are_refused(angles, cause: str) -> None:
    with pytest.raises(InputError, match=cause):
        surfaces.surface_table(surfaces.held_pulses(*session()), angles)


def test_neighboring_samples_count_as_one() -> None:
    """In a slow turn each sample occurs five times: the stated errors are those of the 300 distinct samples."""
    over_stated = []
    for seed in range(10):
        field, hard, _ = measured(seed, by_hand=True)
        calibration = magnetometer.calibrate(np.repeat(field[::5], 5, axis=0), "log")
        over_stated.append((np.array(calibration.hard_iron_T) - hard) / calibration.hard_iron_error_T)
    assert 0.6 < np.sqrt(np.mean(np.square(over_stated))) < 1.5


def pulses(*held: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Pulses (seconds, us) held one after another, at 25 Hz."""
    pulse_us = np.concatenate([np.full(round(25 * seconds), us) for seconds, us in held])
    return np.arange(len(pulse_us)) / 25, pulse_us


def test_a_position_counts_if_it_is_held_for_two_seconds() -> None:
    held_pulses = surfaces.held_pulses(*pulses((3.0, 1500.0), (1.0, 1300.0), (2.5, 1100.0)))
    assert [hold.pulse_us for hold in held_pulses] == [1500.0, 1100.0]
    assert [hold.start_s for hold in held_pulses] == pytest.approx([0.0, 4.0])


def test_positions_apart_by_the_play_of_a_servo_are_one_and_others_are_not() -> None:
    """8 us apart is one position read twice; 40 us apart, two degrees of a usual servo, is two positions."""
    held_pulses = surfaces.held_pulses(*pulses((3.0, 1100.0), (3.0, 1500.0), (3.0, 1540.0), (3.0, 1108.0)))
    table = surfaces.surface_table(held_pulses, (-20.0, 0.0, 2.0, -19.0))
    assert table.pulse_us == [1104, 1500, 1540]
    assert table.angle_deg == pytest.approx([-19.5, 0.0, 2.0])
    assert table.hysteresis_deg == pytest.approx(1.0)


def test_the_axis_that_stays_unknown_is_named_with_its_error_and_the_field(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two turns leave the vertical axis uncertain; the limit is set to a hundredth of the usual one, so this is
    refused."""
    field = measured(0, by_hand=False)[0]
    calibrated = magnetometer.calibrate(field, "log")
    monkeypatch.setattr(magnetometer, "MAGNETOMETER", replace(MAGNETOMETER, worst_rad=MAGNETOMETER.worst_rad / 100))
    with pytest.raises(InputError) as refused:
        magnetometer.calibrate(field, "log")
    message = (
        f"hard iron along z stays uncertain by {1e6 * calibrated.hard_iron_error_T[2]:.0f} uT (1 sigma, of a field of "
    )
    assert message in str(refused.value)
    assert float(str(refused.value).partition(message)[2].partition(")")[0]) == pytest.approx(
        1e6 * calibrated.field_T, abs=0.5
    )
