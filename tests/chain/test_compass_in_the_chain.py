"""`analyze` of a flight without GPS, with and without a calibrated magnetometer."""

import dataclasses
from pathlib import Path

import msgspec
import numpy as np
import pandas as pd
import pytest
from running import done, read_once, rewritten

from flightpower.analysis.air.contents import Replacements, contents
from flightpower.analysis.air.flight_data import flight_data
from flightpower.analysis.air.magnetometer import MAGNETOMETER_FILE, MagnetometerCalibration
from flightpower.analysis.records.flight import Results
from flightpower.analysis.results.flight_found import path_result
from flightpower.analysis.trajectory.consistency import consistency
from flightpower.analysis.trajectory.observability import sensor_error_estimates, trajectory_notes
from flightpower.analysis.trajectory.priors import SensorPriors
from flightpower.analysis.trajectory.reconstruction import reconstruct

pytestmark = pytest.mark.xdist_group("chain")

CALIBRATION = msgspec.json.encode(
    MagnetometerCalibration(
        source="turned about", samples=1000, hard_iron_T=(0.0, 0.0, 0.0), hard_iron_error_T=(1e-6, 1e-6, 1e-6),
        soft_iron=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), soft_iron_error=0.01, field_T=48.5e-6,
        residual_before_T=1e-6, residual_T=1e-6, directions=0.5,
    )
)  # fmt: skip


def analyzed(log: Path, *options: object) -> tuple[Results, pd.DataFrame]:
    done("analyze", log, *options, "--quiet")
    folder = log.with_suffix(".report")
    return msgspec.json.decode((folder / "results.json").read_bytes(), type=Results), pd.read_csv(folder / "path.csv")


def about_heading(results: Results) -> list[str]:
    return [warning for warning in results.warnings if "heading" in warning]


@pytest.mark.slow
def test_the_heading_is_held_by_a_calibration(flown: Path, tmp_path: Path) -> None:
    """The demonstration's magnetometer has 1 uT of iron on each axis, which is the calibration's stated error."""
    rewritten(flown, tmp_path / "without.mcap", without_topic="/gps")
    (tmp_path / "mine.json").write_bytes(CALIBRATION)
    results, path = analyzed(tmp_path / "without.mcap", "--magnetometer", tmp_path / "mine.json")
    assert results.path is not None and "compass" in results.path.residuals
    (message,) = about_heading(results)
    assert "the magnetometer held the heading" in message

    truth = pd.read_parquet(flown / "truth.parquet", columns=["time_s", "height_m", "yaw_rad"])
    true = np.interp(path["t_s"], truth["time_s"], np.unwrap(truth["yaw_rad"]))
    high = np.interp(path["t_s"], truth["time_s"], truth["height_m"]) > 20
    off = (path["yaw_rad"] - true + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(off / path["yaw_rad_error"])[high].max() < 3


def test_a_calibration_in_the_log_is_what_one_given_by_hand_is(flown: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.json").write_bytes(CALIBRATION)
    log = read_once(flown / "log.mcap")
    attached = dataclasses.replace(log, attachments=log.attachments | {"magnetometer.json": CALIBRATION})
    by_option = contents(log, Replacements(magnetometer=MAGNETOMETER_FILE.load(tmp_path / "mine.json")))
    assert by_option.magnetometer is not None and by_option.magnetometer == contents(attached).magnetometer


def test_without_a_calibration_the_log_s_magnetometer_is_named_and_not_used(flown: Path) -> None:
    log = read_once(flown / "log.mcap")
    log = dataclasses.replace(log, entries={topic: e for topic, e in log.entries.items() if topic != "/gps"})
    log_contents = contents(log)
    data = flight_data(log, log_contents.aircraft, log_contents.propeller, log_contents.calibrations)
    alone = reconstruct(
        data.table, data.rest, SensorPriors(alpha_scale_sigma=0.01), compass=data.compass, log="log.mcap"
    )
    errors = sensor_error_estimates(alone)
    notes = trajectory_notes(
        alone, errors, 2, magnetometer_calibrated=log_contents.magnetometer is not None, log="log.mcap"
    )
    (note,) = (note for note in notes if "heading" in note)
    assert "was not determined" in note and "A magnetometer was recorded" in note
    agreement = consistency(alone)
    assert "compass" not in path_result(alone, agreement).residuals
