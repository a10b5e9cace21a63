"""Periods in which a VTOL's lifting motors run say nothing about level flight on the wing and are left out."""

from pathlib import Path

import numpy as np
import pytest

from flightpower.analysis.sources import recording
from flightpower.analysis.sources.ardupilot import read_ardupilot
from flightpower.analysis.sources.recording import Channel, without_hover
from flightpower.sim.dataflash_writer import DataflashMessages, write_dataflash
from tests.analysis.sources.firmware import firmware

T_S = np.arange(0.0, 300.0, 0.1)
HOVER_S = (50.0, 150.0)  # longer than the step that counts as a jump of the clock


def messages(name: str, codes: str, t_s: np.ndarray, **columns: np.ndarray) -> DataflashMessages:
    return DataflashMessages(name, codes, {"TimeUS": (1e6 * (1.0 + t_s)).astype(np.uint64), **columns})


def log(path: Path, lift: np.ndarray | None) -> Path:
    """Write a log of a flight with lift motors at a throttle (n,) over T_S, or without lift motors (None)."""
    wave = np.sin(0.3 * T_S)
    kinds = [
        firmware(),
        messages("ARSP", "Qff", T_S, Airspeed=15.0 + wave, DiffPress=(15.0 + wave) ** 2 / 2),
        messages("BARO", "Qf", T_S, Press=1e5 - 100 * wave),
        messages("BAT", "Qff", T_S, Volt=15.0 + 0.1 * wave, Curr=10.0 + wave),
    ]
    if lift is not None:
        kinds.append(messages("QTUN", "Qf", T_S, ThO=lift))
    write_dataflash(path, kinds)
    return path


def test_hover_of_a_quadplane_is_left_out(tmp_path: Path) -> None:
    hover = (T_S > HOVER_S[0]) & (T_S < HOVER_S[1])
    read = read_ardupilot(log(tmp_path / "vtol.BIN", np.where(hover, 0.4, 0.0)))
    airspeed, static = (read.channels[name].t_s - 1.0 for name in (recording.AIRSPEED_PRESSURE, recording.STATIC))
    assert not ((airspeed > HOVER_S[0] - 0.9) & (airspeed < HOVER_S[1] + 0.9)).any()
    assert airspeed[0] == pytest.approx(0.0, abs=0.2) and airspeed[-1] == pytest.approx(T_S[-1], abs=0.2)
    assert len(static) == len(T_S)
    assert len(read.notes) == 1 and "34 %" in read.notes[0]


@pytest.mark.parametrize("lift", [None, np.zeros(len(T_S))])
def test_a_flight_on_the_wing_is_whole(tmp_path: Path, lift: np.ndarray | None) -> None:
    read = read_ardupilot(log(tmp_path / "plane.BIN", lift))
    assert len(read.channels[recording.AIRSPEED_PRESSURE].t_s) == len(T_S) and not read.notes


def test_the_wing_carries_alone_only_after_the_motors_have_stopped() -> None:
    channels = {recording.AIRSPEED_PRESSURE: Channel(T_S, 0 * T_S + 100.0), recording.STATIC: Channel(T_S, 0 * T_S)}
    left, _ = without_hover(channels, lambda t_s: [np.array([20.0]), np.array([10.0])])
    assert left[recording.STATIC] is channels[recording.STATIC] and without_hover({}, lambda t_s: [t_s]) == ({}, [])
    gone = np.setdiff1d(T_S, left[recording.AIRSPEED_PRESSURE].t_s)
    assert np.all((np.abs(gone - 10) <= 1.0 + 1e-9) | (np.abs(gone - 20) <= 1.0 + 1e-9)) and len(gone) >= 38
