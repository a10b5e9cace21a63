"""A flight without GPS, its magnetometer calibrated or not: what `analyze` makes of it."""

from pathlib import Path

import msgspec
import numpy as np
import pandas as pd
import pytest
from running import done, rewritten

from analysis.airdata.magnetometer import MagnetometerCalibration
from analysis.results.schema import Results

pytestmark = pytest.mark.xdist_group("chain")

CALIBRATION = msgspec.json.encode(
    MagnetometerCalibration(
        source="turned about", samples=1000, hard_iron_T=(0.0, 0.0, 0.0), hard_iron_error_T=(1e-6, 1e-6, 1e-6),
        soft_iron=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), soft_iron_error=0.01, field_T=48.5e-6,
        residual_before_T=1e-6, residual_T=1e-6, directions=0.5,
    )
)  # fmt: skip


def analysed(log: Path, *options: object) -> tuple[Results, pd.DataFrame]:
    done("analyze", log, *options, "--quiet")
    folder = log.with_suffix(".report")
    return msgspec.json.decode((folder / "results.json").read_bytes(), type=Results), pd.read_csv(folder / "path.csv")


def about_heading(results: Results) -> list[str]:
    return [warning for warning in results.warnings if "heading" in warning]


@pytest.mark.slow
def test_the_heading_is_held_by_a_calibration_in_the_log_or_given_by_hand(flown: Path, tmp_path: Path) -> None:
    """The demonstration's magnetometer has 1 uT of iron on each axis, what the calibration says of its error."""
    rewritten(flown, tmp_path / "with.mcap", without_topic="/gps", attached={"magnetometer.json": CALIBRATION})
    rewritten(flown, tmp_path / "without.mcap", without_topic="/gps")
    (tmp_path / "mine.json").write_bytes(CALIBRATION)
    results, path = analysed(tmp_path / "with.mcap")
    given, by_hand = analysed(tmp_path / "without.mcap", "--magnetometer", tmp_path / "mine.json")
    assert by_hand.equals(path) and given.warnings == results.warnings
    assert results.path is not None and "compass" in results.path.residuals
    (said,) = about_heading(results)
    assert "the magnetometer held the heading" in said

    truth = pd.read_parquet(flown / "truth.parquet", columns=["time_s", "height_m", "yaw_rad"])
    true = np.interp(path["t_s"], truth["time_s"], np.unwrap(truth["yaw_rad"]))
    high = np.interp(path["t_s"], truth["time_s"], truth["height_m"]) > 20
    off = (path["yaw_rad"] - true + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(off / path["yaw_rad_error"])[high].max() < 3

    alone, _ = analysed(tmp_path / "without.mcap")
    (said,) = about_heading(alone)
    assert "was not determined" in said and "A magnetometer was recorded" in said
    assert alone.path is not None and "compass" not in alone.path.residuals
