"""Batteries in every usual wiring, and messages in odd orders: the power is that of the propulsion, counted once."""

from pathlib import Path

import numpy as np
import pytest

from flightpower.analysis.sources import recording
from flightpower.analysis.sources.ardupilot import read_ardupilot
from flightpower.sim.dataflash_writer import DataflashMessages, write_dataflash
from tests.analysis.sources.firmware import firmware

T_US = 100_000 * np.arange(1, 1001)
WAVE = np.sin(3e-7 * T_US)
AIR = [
    DataflashMessages("ARSP", "Qff", {"TimeUS": T_US, "Airspeed": 15 + WAVE, "DiffPress": (15 + WAVE) ** 2 / 2}),
    DataflashMessages("BARO", "Qf", {"TimeUS": T_US, "Press": 95_000 + 30 * WAVE}),
]
VOLT, AMPERE = 15.0 - 0.2 * WAVE, 10.0 + 3.0 * WAVE
POWER_W = float(np.mean(VOLT * AMPERE))


def monitor(instance: int, volt: np.ndarray, ampere: np.ndarray, name: str = "BAT") -> DataflashMessages:
    fields = {"TimeUS": T_US, "Inst": np.full(len(T_US), instance), "Volt": volt, "Curr": ampere}
    return DataflashMessages(name, "QBff", fields)


def settings(**values: float) -> DataflashMessages:
    names = {"Name": np.array([name.encode() for name in values]), "Value": np.array([*values.values()])}
    return DataflashMessages("PARM", "QNf", {"TimeUS": np.zeros(len(values)), **names})


def power_W(path: Path, kinds: list[DataflashMessages]) -> float:
    write_dataflash(path, kinds)
    channels = read_ardupilot(path).channels
    current = channels[recording.CURRENT]
    return float(np.mean(current.value * np.interp(current.t_s, *channels[recording.VOLTAGE])))


HALF = AMPERE / 2
WIRINGS: dict[str, list[DataflashMessages]] = {
    "one pack": [monitor(0, VOLT, AMPERE)],
    "two packs in parallel": [monitor(0, VOLT, HALF + 0.4), monitor(1, VOLT, HALF - 0.4)],
    "two packs and their sum, as parameters say": [
        settings(BATT_MONITOR=10.0, BATT2_MONITOR=4.0, BATT3_MONITOR=4.0), monitor(0, VOLT, AMPERE),
        monitor(1, VOLT, 0.65 * AMPERE), monitor(2, VOLT, 0.35 * AMPERE),
    ],
    "two packs and their sum, by the currents": [
        monitor(0, VOLT, 0.65 * AMPERE), monitor(1, VOLT, 0.35 * AMPERE), monitor(2, VOLT, AMPERE),
    ],
    "one pack, measured twice": [monitor(0, VOLT, AMPERE), monitor(1, VOLT + 0.05, 1.005 * AMPERE)],
    "avionics of their own": [monitor(0, 5.1 + 0 * WAVE, 0.3 + 0 * WAVE), monitor(1, VOLT, AMPERE)],
    "a second monitor without current": [monitor(0, VOLT, AMPERE), monitor(1, VOLT, 0 * WAVE)],
    "a speed controller beside the pack": [monitor(0, VOLT, AMPERE), monitor(0, VOLT, 0.95 * AMPERE, "ESC")],
    "a speed controller alone": [monitor(0, VOLT, 0 * WAVE), monitor(0, VOLT, AMPERE, "ESC")],
}  # fmt: skip


@pytest.mark.parametrize("wiring", WIRINGS)
def test_the_propulsion_is_counted_once(wiring: str, tmp_path: Path) -> None:
    assert power_W(tmp_path / "log.BIN", [firmware(), *AIR, *WIRINGS[wiring]]) == pytest.approx(POWER_W, rel=0.01)


BAT = monitor(0, VOLT, AMPERE)
TWICE = DataflashMessages("BAT", BAT.codes, {name: np.repeat(x, 2) for name, x in BAT.columns.items()})
ORDERS: dict[str, list[DataflashMessages]] = {
    "what says the vehicle at the end": [*AIR, BAT, firmware()],
    "the second instance first": [firmware(), *AIR, monitor(1, 5.1 + 0 * WAVE, 0.3 + 0 * WAVE), BAT],
    "each message twice": [firmware(), *AIR, TWICE],
    "the battery before the air": [BAT, firmware(), *AIR[::-1]],
    "the battery from the middle on": [firmware(), *AIR, BAT.selected(T_US > 50_000_000)],
}


@pytest.mark.parametrize("order", ORDERS)
def test_the_order_of_messages_changes_nothing(order: str, tmp_path: Path) -> None:
    late = 0.03 if "middle" in order else 0.003  # the second half has another mean
    assert power_W(tmp_path / "log.BIN", ORDERS[order]) == pytest.approx(POWER_W, rel=late)
