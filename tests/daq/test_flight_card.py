"""The planner's card: each planned run is ticked off by a good run that covers it, as often as it is planned."""

from pathlib import Path

import numpy as np
import pytest
from test_run_monitor import means_at

from flightpower.analysis.cli.plan import PlanOptions, flight_plan
from flightpower.analysis.missions.card import runs_to_tick_off
from flightpower.daq.flight_card import FlightCard, PlannedRun, load_card
from flightpower.daq.run_monitor import RunMonitor
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.errors import InputError


def card(times: int = 2) -> FlightCard:
    return FlightCard([
        PlannedRun(kind="acceleration", from_mps=12.0, to_mps=22.0, times=times),
        PlannedRun(kind="deceleration", from_mps=22.0, to_mps=12.0),
    ])  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "first", "last", "planned"),
    [
        ("acceleration", 12.5, 21.0, True),
        ("acceleration", 12.0, 18.9, False),  # 69 % of the planned change
        ("acceleration", 15.0, 26.0, True),
        ("deceleration", 22.0, 13.0, True),
        ("deceleration", 30.0, 21.0, False),
    ],
)
def test_a_run_is_ticked_off_if_it_covers_a_planned_one(kind, first, last, planned):
    assert card().tick_off(kind, first, last) is planned


def test_each_planned_run_is_counted_as_often_as_it_is_planned():
    flown = card(times=2)
    assert [flown.tick_off("acceleration", 12.0, 22.0) for _ in range(3)] == [True, True, False]
    assert flown.lines[0].startswith("2 of 2") and flown.lines[1].startswith("0 of 1")
    assert flown.text == "card: 2 of 3, next deceleration to 12.0 m/s" and len(flown.text) <= 50
    flown.tick_off("deceleration", 22.0, 12.0)
    assert "all 3" in flown.text


def test_the_monitor_ticks_off_a_good_run_once(tmp_path):
    """Speed is held after the acceleration, so that it is judged before its leg has ended, and again at the end."""
    monitor, texts = RunMonitor(load_aircraft("nexstar"), None, card=card()), []
    for i in range(250):
        t = 0.2 * (i + 0.5)
        speed = 0.0 if t < 10 else 12.0 + 10.0 * min(max((t - 18) / 14, 0.0), 1.0)
        texts += monitor.texts(means_at(t, speed if t < 48 else 15.0, 60.0 * (t > 10), n=80.0 * (t > 10)))
    assert [text for _, text in texts if text.startswith("card")] == ["card: 1 of 3, next acceleration to 22.0 m/s"]
    assert monitor.card.lines[0].startswith("1 of 2")


def test_a_run_that_goes_on_after_it_was_reported_is_ticked_off_once():
    """Speed is held for six seconds at 18 m/s and then rises: a second verdict on the same leg replaces the first."""
    planned = FlightCard([PlannedRun(kind="acceleration", from_mps=12.0, to_mps=18.0, times=3)])
    monitor, good = RunMonitor(load_aircraft("nexstar"), None, card=planned), 0
    for i in range(300):
        t = 0.2 * (i + 0.5)
        speed = 0.0 if t < 10 else float(np.interp(t, (18, 27, 33, 40), (12.0, 18.0, 18.0, 23.0)))
        texts = monitor.texts(means_at(t, speed if t < 50 else 15.0, 60.0 * (t > 10), n=80.0 * (t > 10)))
        good += sum(text.startswith("acceleration good") for _, text in texts)
    assert good == 2 and planned.lines[0].startswith("1 of 3")


@pytest.mark.thorough
@pytest.mark.slow
def test_the_planners_card_is_the_daemons(tmp_path):
    (tmp_path / "card.toml").write_text(runs_to_tick_off(flight_plan("nexstar", PlanOptions(minutes=7.0))))
    planned = load_card(str(tmp_path / "card.toml"))._planned
    assert {item.kind for item in planned} == {"acceleration", "deceleration"}
    assert all((item.to_mps > item.from_mps > 5.0) == (item.kind == "acceleration") for item in planned)


@pytest.mark.parametrize("text", ["", "[[run]]\nkind = 'turn'\nfrom_mps = 1\nto_mps = 2", "run = 3"])
def test_another_file_is_refused_in_one_line(text, tmp_path: Path):
    (tmp_path / "card.toml").write_text(text)
    with pytest.raises(InputError) as error:
        load_card(str(tmp_path / "card.toml"))
    assert "card.toml" in str(error.value) and "\n" not in str(error.value)
