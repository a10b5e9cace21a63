"""The curve of one half of a real PX4 flight predicts the energy of the other half without its data."""

from typing import NamedTuple

import numpy as np
import pytest

from flightpower.analysis.curve import Condition
from flightpower.analysis.methods.whole_flight.curve import FlownAircraft, estimate
from flightpower.analysis.methods.whole_flight.fit import samples_of
from flightpower.analysis.methods.whole_flight.flight_table import FlightTable, flight_table
from flightpower.analysis.missions.power import source_of
from flightpower.analysis.results.energy_balance import EnergyBalanceFindings, assemble_energy_balance
from flightpower.analysis.results.provenance import provenance_of_file
from flightpower.analysis.sources.px4 import read_px4
from flightpower.flight.units import GRAVITY_MPS2
from tests.analysis.missions.route_data import of_results
from tests.shared_data import beside, needs

LOG = beside("pixhawk/seaway-mini-flight3.ulg")
pytestmark = needs(LOG)
WEIGHT_N, AREA_M2, SPAN_M = 9.4 * GRAVITY_MPS2, 1.499, 4.0
WINDOW_S = 10.0


class Half(NamedTuple):
    measured_J: float
    drawn_J: np.ndarray


def only(flight: FlightTable, rows: slice) -> FlightTable:
    """Return these rows as a separate flight."""
    airborne = [
        slice(max(item.start, rows.start), min(item.stop, rows.stop))
        for item in flight.airborne
        if item.start < rows.stop and rows.start < item.stop
    ]
    inside = np.zeros(len(flight.flown), dtype=bool)
    inside[rows] = True
    return flight._replace(airborne=airborne, flown=flight.flown & inside)


def predicted(first: FlightTable, second: FlightTable) -> Half:
    electrical = estimate(first, WEIGHT_N, AREA_M2, SPAN_M)
    rho = electrical.conditions.rho
    results = assemble_energy_balance(
        LOG,
        FlownAircraft("Seaway-Mini", WEIGHT_N, AREA_M2, SPAN_M),
        EnergyBalanceFindings(first, electrical),
        provenance_of_file(LOG, "", None, ""),
    )
    rng = np.random.default_rng(0)
    power = source_of(of_results(results), None, 1000, rng).power_draws
    samples = samples_of(second, electrical.airspeed.scale, electrical.airspeed.zero_Pa)
    measured_J, drawn_J = 0.0, np.zeros(1000)
    for rows in second.airborne:
        count = int((samples.t_s[rows.stop - 1] - samples.t_s[rows.start]) / WINDOW_S)
        for part in np.array_split(np.arange(rows.start, rows.stop), max(count, 1)):
            V, seconds = samples.V_mps[part], float(samples.t_s[part[-1]] - samples.t_s[part[0]])
            mean = float(np.mean(V))
            rise_m = float(samples.height_m[part[-1]] - samples.height_m[part[0]] + (V[-1] ** 2 - V[0] ** 2) / 19.6)
            load = float(np.sqrt(np.mean(samples.load_factor[part] ** 2)))
            condition = Condition(np.array([WEIGHT_N]), np.array([rho]), AREA_M2)
            sine = rise_m / (mean * seconds)
            drawn_J += seconds * power.battery_W(np.array([mean]), condition, sine, load)[:, 0]
            measured_J += seconds * float(np.mean(samples.power_W[part]))
    return Half(measured_J, drawn_J * (1 + 0.03 * rng.standard_normal(1000)))


@pytest.fixture(scope="module")
def halves() -> tuple[FlightTable, FlightTable]:
    flight = flight_table(read_px4(LOG), WEIGHT_N, AREA_M2)
    flown = np.flatnonzero(flight.flown)
    middle = int(flown[len(flown) // 2])
    return only(flight, slice(0, middle)), only(flight, slice(middle, len(flight.flown)))


@pytest.mark.parametrize("forward", [True, False])
def test_the_energy_of_the_other_half_lies_in_the_interval(halves, forward: bool) -> None:
    """The halves last two minutes each, at 8 to 12 and at 9 to 20 m/s; such short data give a wide interval."""
    half = predicted(*(halves if forward else reversed(halves)))
    low, median, high = np.quantile(half.drawn_J, [0.025, 0.5, 0.975])
    assert low < half.measured_J < high
    assert median == pytest.approx(half.measured_J, rel=0.15)
    assert (high - low) / 2 < (0.45 if forward else 0.28) * median
