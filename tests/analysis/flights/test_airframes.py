"""Curves of airframes, and of the fleet that they are drawn from."""

import html
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fleet_flights import POLAR, flights_of

from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.flights.airframes import airframes, fleet_curve, random_effects
from flightpower.analysis.flights.dataset import Dataset
from flightpower.analysis.flights.fleet_summary import fleet_results
from flightpower.analysis.pages.fleet_page import doubts, history_figure, render_fleet
from flightpower.analysis.records.fleet import Contradiction, What
from flightpower.analysis.records.flight import Trust


def test_the_scatter_among_airframes_is_distinguished_from_the_errors_of_each() -> None:
    """Over 400 draws; a flight's own errors are as large as the scatter among airframes."""
    rng = np.random.default_rng(4)
    among = np.array([[1.0, 0.5], [0.5, 2.0]])
    own = np.stack([np.diag(rng.uniform(0.5, 2.0, 2)) for _ in range(400)])
    values = rng.multivariate_normal([3.0, 5.0], among, 400) + np.stack(
        [rng.multivariate_normal([0, 0], C) for C in own]
    )
    assert random_effects(values, own) == pytest.approx(among, abs=0.4)


def test_airframes_that_do_not_differ_have_next_to_no_scatter() -> None:
    rng = np.random.default_rng(5)
    values = rng.standard_normal((100, 2))
    assert np.diag(random_effects(values, np.tile(np.eye(2), (100, 1, 1)))) == pytest.approx(0.0, abs=0.25)


def fleet_of(tmp_path: Path, count: int, **options: object) -> Dataset:
    """Drag of the airframes differs by 4 % (standard deviation)."""
    dataset = Dataset(str(tmp_path / "fleet"))
    rng = np.random.default_rng(7)
    for i in range(count):
        polar = POLAR * (1 + 0.04 * rng.standard_normal())
        dataset.add(flights_of(f"airframe-{i}", 100 + i, 8, polar=polar, **options))  # type: ignore[arg-type]
    return dataset


def test_another_airframe_s_power_is_as_uncertain_as_airframes_differ(tmp_path: Path) -> None:
    fleet = airframes(fleet_of(tmp_path, 12, noise=0.3), 1.0, [])
    curve = fleet_curve(fleet)
    gradient = np.array([1.0, 0.6, 0.36])
    drag, true = gradient @ curve.mean.A, gradient @ POLAR
    mean_error, another_error = (
        np.sqrt(gradient @ C @ gradient) / true for C in (curve.mean.covariance, curve.of_another.covariance)
    )
    assert abs(drag / true - 1) < NORMAL_95 * mean_error
    assert 0.02 < another_error < 0.08 and mean_error < 0.6 * another_error


def test_a_changed_airframe_is_pooled_since_its_change_and_told_on_the_page(tmp_path: Path) -> None:
    dataset = fleet_of(tmp_path, 3, noise=0.3)
    dataset.add(flights_of("worn", 9, 30, thrust=-0.06 * (np.arange(30) >= 20), noise=0.3))
    results = fleet_results(airframes(dataset, 1.0, []), [])
    worn = next(airframe for airframe in results.airframes if airframe.name == "worn")
    (change,) = worn.changes
    assert change.what is What.PROPULSION and change.since_log == "worn-020.mcap"
    assert (worn.flights, worn.pooled_flights) == (30, 10)
    assert change.thrust_percent == pytest.approx(-6, abs=1.5)
    assert worn.trust is Trust.TRUSTED
    page = render_fleet(results)
    assert change.text in page and "10 February 2026" in change.text


@pytest.mark.parametrize("undated", [range(0), range(10), range(1, 3)])
def test_a_change_is_reported_of_flights_with_dates_alone(tmp_path: Path, undated: range) -> None:
    """Ten flights, the last four with 30 % more drag. Undated flights are sorted by a hash of their contents, which
    says nothing about time. When only two flights from before the change are undated, the change is reported, and
    those two, which may be of any date, stay out of the pool since the change."""
    flights = flights_of("one", 3, 10, drag=0.3 * (np.arange(10) >= 6), noise=0.3)
    for i in undated:
        flights[i]["pooling"]["start_unix_s"] = None
    dataset = Dataset(str(tmp_path / "fleet"))
    dataset.add(flights)
    results = fleet_results(airframes(dataset, 1.0, []), [])
    (airframe,) = results.airframes
    if len(undated) == 10:
        assert not airframe.changes and airframe.pooled_flights == 10 and airframe.first_unix_s is None
        assert airframe.trust is not Trust.TRUSTED, "that the flights differ is reported all the same"
    else:
        (change,) = airframe.changes
        assert change.since_log == "one-006.mcap" and airframe.pooled_flights == 4
        assert change.drag_percent == pytest.approx(30, abs=6)
        assert airframe.last_unix_s == flights[-1]["pooling"]["start_unix_s"]
    message = [f"one: {len(undated)} of 10 flights have no date"] if undated else []
    assert [note.split(" (")[0] for note in results.notes] == message
    assert all(note in html.unescape(render_fleet(results)) for note in results.notes)


def test_flights_that_differ_make_the_curve_of_their_airframe_doubtful(tmp_path: Path) -> None:
    """One of six flights has a fifth less drag; it is reported, but not as a change of the airframe."""
    dataset = Dataset(str(tmp_path / "fleet"))
    dataset.add(flights_of("one", 3, 6, drag=-0.2 * (np.arange(6) == 2), noise=0.3))
    dataset.add(flights_of("two", 4, 6, noise=0.3))
    results = fleet_results(airframes(dataset, 1.0, []), [])
    item, two = results.airframes
    assert item.trust is not Trust.TRUSTED and two.trust is Trust.TRUSTED
    assert any("one-002" in text for text in doubts(results))


@pytest.mark.parametrize(
    ("installations", "spans", "expected"),
    [
        ("aabb", (2, 2, 2, 2), []),
        ("abab", (2, 2, 2, 2), [(Contradiction.INSTALLATION, "one-002.mcap", "one-000.mcap")]),
        ("aaaa", (2, 2, 3, 2), [(Contradiction.SIZE, "one-002.mcap", "one-000.mcap")]),
    ],
)
def test_flights_of_one_name_that_cannot_be_of_one_airframe_are_reported(
    tmp_path: Path, installations, spans, expected
) -> None:
    dataset = Dataset(str(tmp_path / "fleet"))
    flights = flights_of("one", 3, 4, noise=0.3)
    for flight, installation, span_m in zip(flights, installations, spans, strict=True):
        flight["pooling"]["installation"], flight["aircraft"]["span_m"] = installation, float(span_m)
    dataset.add(flights)
    results = fleet_results(airframes(dataset, 1.0, []), [])
    assert [
        (contradiction.kind, contradiction.log, contradiction.earlier_log) for contradiction in results.contradictions
    ] == expected
    assert len(doubts(results)) >= len(expected)
    texts = {
        Contradiction.INSTALLATION: "one-002.mcap names the installation 'a' of one-000.mcap again, after one-001.mcap"
        " with 'b': if the instruments were remounted, give the installation a new name",
        Contradiction.SIZE: "one: one-002.mcap has another wing area or span than one-000.mcap: two aircraft",
    }
    assert all(texts[contradiction.kind] in contradiction.text for contradiction in results.contradictions)


def test_one_flight_under_the_names_of_two_airframes_is_reported(tmp_path: Path) -> None:
    """A log was also analyzed with another airframe's file."""
    dataset = Dataset(str(tmp_path / "fleet"))
    flights = flights_of("one", 3, 4, noise=0.3)
    dataset.add(flights)
    moved = [{**flight, "aircraft": {**flight["aircraft"], "name": "two"}} for flight in flights[1:3]]
    dataset.add([*moved, *flights_of("two", 4, 2, noise=0.3)])
    (contradiction,) = fleet_results(airframes(dataset, 1.0, []), []).contradictions
    assert (contradiction.kind, contradiction.airframe, contradiction.earlier_log) == (
        Contradiction.FLIGHT,
        "two",
        "one-001.mcap",
    )
    assert "and 1 more are flights of one" in contradiction.text


def test_the_history_is_drawn_over_days_that_are_reported_as_dates() -> None:
    """Flights from 1 May 2024, 19844 days after 1 January 1970, every two days; a tick for each day in UTC."""
    shares = dict.fromkeys(("drag_half_width_percent", "thrust_percent", "thrust_half_width_percent"), 1.0)
    history = [SimpleNamespace(start_unix_s=86400.0 * (19844 + 2 * i), drag_percent=i, **shares) for i in range(3)]
    figure = history_figure(SimpleNamespace(history=history, changes=[]))  # type: ignore[arg-type]
    assert figure.x.ticks == {19844.0 + i: f"{1 + i} May" for i in range(5)}
