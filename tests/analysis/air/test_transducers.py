"""A calibration recovers slope and offset of the transducers within the errors that it states."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from flightpower.analysis.air.transducers import (
    TRANSDUCERS_FILE,
    TransducerCalibration,
    air_data_errors,
    in_words,
    plateaus,
)
from flightpower.analysis.calibrations.transducers import calibrate, pressures_Pa
from flightpower.analysis.cli.calibrate import app
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.priors import PRIOR_SIGMA, SensorPriors, sensor_error_prior
from flightpower.flight.errors import InputError
from flightpower.flight.messages import DifferentialPressure, Status
from tests.analysis.cli.test_calibrate import written

PRESSURES_PA = (100.0, 200.0, 300.0, 400.0, 350.0, 250.0, 150.0, 50.0)
SLOPES, OFFSETS_PA = np.array([0.97, 1.03, 1.02]), np.array([4.0, -6.0, 8.0])


def column(pressures=PRESSURES_PA, *, seed: int = 0, hold_s: float = 8.0, noise_Pa: float = 6.0) -> pd.DataFrame:
    """Readings at 25 Hz of these pressures, with an open tube before and after; each change takes two seconds."""
    times = np.cumsum([0.0, *[hold_s, 2.0] * (len(pressures) + 1), hold_s])
    t_s = np.arange(0.0, times[-1], 0.04)
    p = np.interp(t_s, times, np.repeat([0.0, *pressures, 0.0], 2))
    noise = noise_Pa * np.random.default_rng(seed).standard_normal((len(t_s), 3))
    values = OFFSETS_PA + SLOPES * p[:, None] + noise
    return pd.DataFrame(values, pd.Index(t_s, name="t_s"), ["alpha", "beta", "airspeed"])


def calibration_of(
    seed: int = 0, reading_Pa: float = 0.0, scale: float = 0.0, **options
) -> tuple[TransducerCalibration, str]:
    """Calibrates by a reference whose scale and readings have errors."""
    rng = np.random.default_rng([seed, 1])
    entered_Pa = np.array(PRESSURES_PA) * (1 + scale * rng.standard_normal())
    entered_Pa += reading_Pa * rng.standard_normal(len(entered_Pa))
    return calibrate(plateaus(column(seed=seed, **options), "log"), entered_Pa.tolist(), scale, "log")


def test_slopes_lie_within_their_errors() -> None:
    """Over 30 water columns read to 0.3 mm on a ruler good to 0.5 %, errors over stated errors have an rms near 1."""
    over_stated, errors = [], []
    for seed in range(30):
        calibration, unsupported = calibration_of(seed, reading_Pa=3.0, scale=0.005)
        assert not unsupported
        lines = [calibration.line(name) for name in ("alpha", "beta", "airspeed")]
        over_stated.append([(line.slope - s) / line.slope_error for line, s in zip(lines, SLOPES, strict=True)])
        errors.append(calibration.airspeed_scale_error)
        assert calibration.airspeed_scale == pytest.approx(np.sqrt(1.02) - 1, abs=4 * errors[-1])
    assert 0.6 < np.sqrt(np.mean(np.square(over_stated))) < 1.2
    assert np.median(errors) < 0.005, "airspeed to 0.5 %"


def test_a_reference_that_is_too_uncertain_is_named_with_its_error() -> None:
    """Airspeed goes with the square root of pressure, so its error is half of the reference's 5 %."""
    _, unsupported = calibration_of(scale=0.05)
    assert unsupported.startswith(
        "the standard error of airspeed is 2.5 %, more than 1.0 %: the reference is known to 5.0 %"
    )


def test_corrected_readings_are_the_pressures_of_the_reference() -> None:
    calibration, _ = calibration_of(noise_Pa=0.0)
    table = column(noise_Pa=0.0).set_axis(["dp_alpha_Pa", "dp_beta_Pa", "q_c_Pa"], axis=1)
    corrected = calibration.corrected(table.assign(static_Pa=1e5))
    assert corrected["q_c_Pa"].max() == pytest.approx(400.0) and corrected["dp_beta_Pa"].max() == pytest.approx(400.0)
    assert (corrected["static_Pa"] == 1e5).all()
    zero = calibration.corrected_zero({"q_c_Pa": 8.0, "p_radps": 0.1})
    assert zero == pytest.approx({"q_c_Pa": 0.0, "p_radps": 0.1}, abs=1e-9)


def test_the_standard_errors_replace_the_priors() -> None:
    calibration, _ = calibration_of(scale=0.005)
    assert calibration.airspeed_scale_error == pytest.approx(0.0025, rel=0.2), "half that of the pressure"
    for calibrated in ({}, air_data_errors(calibration)._asdict()):
        _, sigma = sensor_error_prior(SensorPriors(calibrated=calibrated), gps=True)
        by_name = dict(zip(SENSOR_ERRORS, sigma, strict=True))
        if calibrated:
            assert calibrated["V_scale"] < by_name["V_scale"] < 0.005
            assert calibrated["alpha_scale"] < by_name["alpha_scale"] < 0.01
        else:
            assert (by_name["V_scale"], by_name["alpha_scale"]) == (PRIOR_SIGMA["V_scale"], PRIOR_SIGMA["alpha_scale"])


def test_a_calibration_that_its_data_do_not_support_says_why() -> None:
    assert "airspeed is 2.5 %" in calibration_of(scale=0.05)[1]
    assert "look for a leak" in calibration_of(reading_Pa=30.0)[1]
    swapped = [*PRESSURES_PA[:2], PRESSURES_PA[3], PRESSURES_PA[2], *PRESSURES_PA[4:]]
    assert "a wrong order" in calibrate(plateaus(column(), "log"), swapped, 0.0, "log")[1]


@pytest.mark.parametrize(
    ("pressures", "entered", "cause"),
    [
        (PRESSURES_PA, PRESSURES_PA[:-1], "7 pressures for 8 plateaus"),
        ((100.0, 200.0, 100.0, 200.0), (100.0, 200.0, 100.0, 200.0), "2 pressures besides zero are too few"),
        (PRESSURES_PA, tuple(-p for p in PRESSURES_PA), "/probe/alpha falls as the pressure rises"),
        (PRESSURES_PA, tuple(2 * p for p in PRESSURES_PA), "/probe/alpha reads 0.49 times the pressures given"),
    ],
)
def test_pressures_that_are_not_those_of_the_log_are_refused(pressures, entered, cause: str) -> None:
    with pytest.raises(InputError, match=cause):
        calibrate(plateaus(column(pressures), "log"), entered, 0.005, "log")


def test_a_list_of_pressures_has_its_unit_at_the_end() -> None:
    assert pressures_Pa("0, 100, 200 Pa") == [100.0, 200.0], "those at zero are known"
    assert pressures_Pa("10 -20 mm") == pytest.approx([97.89, -195.78], rel=1e-4), "water at 20 degC"
    assert pressures_Pa("1 inH2O") == pytest.approx([249.089], rel=1e-5)
    for wrong, cause in (("10 20", "their unit are needed"), ("10 kg", "no unit of pressure"), ("ten Pa", "no number"),
                         ("10 m", "not within"), ("nan Pa", "no number")):  # fmt: skip
        with pytest.raises(InputError, match=cause):
            pressures_Pa(wrong)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    messages = [
        (f"/probe/{name}", t, DifferentialPressure(differential_pressure_Pa=value, status=status))
        for name, values in column(hold_s=6.0).items()
        for t, value in values.items()
        for status in [Status.SATURATED if value > 900 else Status.OK]
    ]
    path = tmp_path_factory.mktemp("column") / "log.mcap"
    return written(path, sorted(messages, key=lambda message: message[1]))


def run(*arguments: object):
    return CliRunner().invoke(app, ["transducers", *(str(a) for a in arguments)])


def test_the_command_lists_plateaus_writes_a_file_and_refuses_what_is_not_supported(log: Path, tmp_path: Path) -> None:
    output = tmp_path / "transducers.json"
    listed = run(log, "-o", output)
    assert listed.exit_code == 0 and "8: 59 Pa at" in listed.output and not output.exists()
    arguments = ("--pressures", " ".join(f"{p:g}" for p in PRESSURES_PA) + " Pa", "-o", output)
    refused = run(log, *arguments, "--reference-error", "5")
    assert refused.exit_code == 1 and "nothing written" in refused.output and not output.exists()
    assert run(log, *arguments).exit_code == 0
    text = output.read_bytes()
    assert TRANSDUCERS_FILE.parsed(text, "file").airspeed.slope == pytest.approx(1.02, abs=0.005)
    for wrong, cause in (
        ({"format": "flightpower-probe-2"}, "not supported"),
        ({"airspeed_scale_error": 0.0}, "airspeed_scale_error 0"),
        ({"alpha": json.loads(text)["alpha"] | {"slope": 3.0}}, "alpha: slope 3"),
    ):
        with pytest.raises(InputError, match=cause):
            TRANSDUCERS_FILE.parsed(json.dumps(json.loads(text) | wrong).encode(), "file")


def held(*pieces: tuple[float, float], noise_Pa: float = 0.0, drift_Pa: float = 0.0) -> pd.DataFrame:
    """Readings at 25 Hz from 100 s on, of pressures [Pa] held for so many seconds each; the last one drifts
    linearly."""
    values = np.concatenate([np.full(round(25 * seconds), pressure) for pressure, seconds in pieces])
    last = round(25 * pieces[-1][1])
    values[len(values) - last :] += np.linspace(0, drift_Pa, last)
    values = values + noise_Pa * np.random.default_rng(0).standard_normal(len(values))
    return pd.DataFrame(dict.fromkeys(("alpha", "beta", "airspeed"), values), 100 + np.arange(len(values)) / 25)


@pytest.mark.parametrize(("seconds", "count"), [(4.8, 1), (5.6, 2)])
def test_a_pressure_is_held_for_five_seconds(seconds: float, count: int) -> None:
    """Smoothing over half a second removes a quarter of a second at either end."""
    seen = plateaus(held((0.0, 8.0), (200.0, seconds), (500.0, 2.0)), "log")
    assert len(seen) == count
    assert seen[0].open and seen[0].start_s == pytest.approx(100.0) and seen[0].end_s == pytest.approx(108.0, abs=0.3)


@pytest.mark.parametrize(("drift_Pa", "is_full_length"), [(2.6, True), (3.6, False)])
def test_a_held_pressure_stays_within_3_pascals_of_its_first_second(drift_Pa: float, is_full_length: bool) -> None:
    """A larger drift ends the hold: with 3.6 Pa in 20 s, the last three seconds are too short for another hold."""
    seen = plateaus(held((0.0, 8.0), (200.0, 20.0), drift_Pa=drift_Pa), "log")
    assert len(seen) == 2 and (seen[1].end_s > 127.5) is is_full_length


def test_noise_allows_more_by_five_of_its_standard_errors() -> None:
    """40 Pa of noise averaged over half a second allow 11 Pa: a drift of 30 Pa is still held, one of 200 Pa is not."""
    quiet = plateaus(held((0.0, 8.0), (500.0, 10.0), noise_Pa=40.0, drift_Pa=30.0), "log")
    assert len(quiet) == 2 and quiet[1].end_s == pytest.approx(118.0, abs=0.5)
    moving = plateaus(held((0.0, 8.0), (500.0, 10.0), noise_Pa=40.0, drift_Pa=200.0), "log")
    assert len(moving) == 1 or moving[1].end_s < 117.0


def test_tubes_are_open_where_the_pressure_is_steady_at_the_first() -> None:
    seen = plateaus(held((10.0, 8.0), (410.0, 8.0), (12.8, 8.0), (32.0, 8.0), (410.0, 8.0)), "log")
    assert [plateau.open for plateau in seen] == [True, False, True, False, False]
    assert [plateau.readings_Pa[2] for plateau in seen] == pytest.approx([10.0, 410.0, 12.8, 32.0, 410.0], abs=0.01)
    assert in_words(seen) == "zero at 100 s, 1: 410 Pa at 108 s, zero at 116 s, 2: 32 Pa at 124 s, 3: 410 Pa at 132 s"


@pytest.mark.parametrize(("missing", "refused"), [(0.18, False), (0.22, True)])
def test_a_fifth_of_a_plateau_s_readings_may_be_missing(missing: float, refused: bool) -> None:
    table = held((0.0, 8.0), (200.0, 20.0))
    rows = np.flatnonzero(table["airspeed"].to_numpy() > 100)
    table.iloc[rows[np.arange(len(rows)) % 50 < 50 * missing], 1] = np.nan
    if refused:
        with pytest.raises(InputError, match="/probe/beta has no good readings at 108 s"):
            plateaus(table, "log")
    else:
        assert plateaus(table, "log")[1].readings_Pa[1] == pytest.approx(200.0)
