"""Sizes of a fleet's figures: the scatter among airframes, the prediction for a new airframe, and which flights form a
pool."""

from pathlib import Path

import numpy as np
import pytest
from fleet_flights import POLAR, flights_of

from flightpower.analysis.curve import Polar
from flightpower.analysis.flights.airframes import FleetCurve, airframe, airframes, fleet_curve, random_effects
from flightpower.analysis.flights.dataset import Dataset
from flightpower.analysis.flights.flight_statistics import read_statistics


@pytest.mark.parametrize("count", [3, 5, 12])
def test_the_scatter_of_a_few_airframes_known_exactly_is_that_of_their_sample(count: int) -> None:
    """Restricted likelihood divides by n - 1; division by n would make three airframes look a third more alike."""
    values = np.random.default_rng(count).normal(2.0, 3.0, (count, 1))
    effects = random_effects(values, np.full((count, 1, 1), 1e-6))
    assert effects[0, 0] == pytest.approx(np.var(values, ddof=1), rel=1e-3)


def test_another_airframe_is_as_uncertain_as_the_mean_and_the_scatter_together() -> None:
    mean, among = np.diag([4.0, 1.0, 9.0]), np.array([[5.0, 1, 0], [1, 3, 0], [0, 0, 2]])
    curve = FleetCurve(Polar(POLAR, mean), among)
    assert curve.of_another.covariance == pytest.approx(np.array([[9.0, 1, 0], [1, 4, 0], [0, 0, 11]]))
    assert curve.of_another.A == pytest.approx(POLAR)


def test_the_mean_of_a_fleet_is_known_as_well_as_its_airframes_allow(tmp_path: Path) -> None:
    """Its variance is the inverse of the airframes' summed information; each variance is its own plus the scatter."""
    dataset = Dataset(str(tmp_path / "fleet"))
    rng = np.random.default_rng(3)
    for i in range(4):
        dataset.add(flights_of(f"airframe-{i}", i, 3 + i, polar=POLAR * (1 + 0.05 * rng.standard_normal()), noise=0.3))
    fleet = airframes(dataset, 1.0, [])
    curve = fleet_curve(fleet)
    information = sum(np.linalg.inv(airframe.pool.polar.covariance + curve.among_airframes) for airframe in fleet)
    assert curve.mean.covariance == pytest.approx(np.linalg.inv(information), rel=1e-6)


@pytest.mark.parametrize("key", ["propeller_table", "installation", "probe_calibration"])
def test_flights_with_another_propeller_installation_or_calibration_are_another_configuration(
    key: str, tmp_path: Path
) -> None:
    """An error that two flights do not share must not be estimated as one."""
    flights = flights_of("mine", 5, 5, noise=0.3)
    for flight in flights[3:]:
        flight["pooling"][key] = "another"
    dataset = Dataset(str(tmp_path / "fleet"))
    dataset.add(flights)
    assert sorted(len(of_one) for of_one in dataset.flights("mine").values()) == [2, 3]
    assert sorted(len(airframe.flights) for airframe in airframes(dataset, 1.0, [])) == [2, 3]


def test_who_accepts_more_false_alarms_is_reported_of_smaller_changes() -> None:
    """With steps of drag of 0 to 6 %, ten false alarms a year report all that one in a thousand years reports, and
    more."""
    message: dict[float, int] = {0.001: 0, 10.0: 0}
    for step in np.linspace(0.0, 0.06, 13):
        flights = [read_statistics(flight) for flight in flights_of("mine", 3, 10, drag=step * (np.arange(10) >= 5))]
        for alarms in message:
            message[alarms] += bool(airframe("mine", "", flights, alarms).changes)
    assert message[0.001] < message[10.0] <= 13
