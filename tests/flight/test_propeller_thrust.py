"""Thrust and power from coefficients (3.48), and what a propeller does beyond zero thrust and when it stands."""

import numpy as np
import pytest

from flightpower.flight.propeller import Propeller, Row, TableCell, TableCells
from flightpower.flight.propeller_files import load_propeller, parse_uiuc

TABLE = Propeller(
    "table",
    0.3,
    (
        Row(3000.0, (0.0, 0.4, 0.8), (0.1, 0.08, 0.0), (0.04, 0.04, 0.01)),
        Row(6000.0, (0.0, 0.8), (0.12, 0.02), (0.05, 0.02)),
    ),
)


def test_thrust_and_power_grow_with_speed_diameter_and_density():
    """T = cT rho n^2 D^4 and P = cP rho n^3 D^5, at the same advance ratio."""
    thrust_N, power_W = TABLE.thrust_and_power(0.0, 50.0, 1.2)
    assert thrust_N == pytest.approx(0.1 * 1.2 * 50.0**2 * 0.3**4)
    assert power_W == pytest.approx(0.04 * 1.2 * 50.0**3 * 0.3**5)


@pytest.mark.parametrize("name", ["apc-10x5e", "apc-12x8e", "blade-11x5", "blade-16x10"])
def test_efficiency_is_below_one_wherever_the_propeller_pulls(name):
    propeller = load_propeller(name)
    n, V = np.meshgrid(np.linspace(40.0, 150.0, 20), np.linspace(1.0, 30.0, 40))
    thrust_N, power_W = propeller.thrust_and_power(V, n, 1.2)
    pulls = (thrust_N > 0) & propeller.covers(V / (n * propeller.diameter_m), 60 * n)
    assert pulls.sum() > 100
    assert np.all(thrust_N[pulls] * V[pulls] < 0.9 * power_W[pulls])


def test_folded_blades_leave_a_friction_of_0_0015_square_diameters_and_take_no_power():
    """docs/understand/simulation.md; a drag area f is a thrust of -rho V^2 f / 2."""
    folded = TABLE.with_beyond_zero_thrust("fold")
    V, n, rho = 40.0, 50.0, 1.2  # J = 2.7, far beyond zero thrust
    thrust_N, power_W = folded.thrust_and_power(V, n, rho)
    assert thrust_N == pytest.approx(-rho * V**2 / 2 * 0.0015 * 0.3**2, rel=0.04)
    assert power_W == 0.0
    assert thrust_N == pytest.approx(folded.standing_thrust(V, rho))


def test_standing_blades_have_a_drag_area_of_0_042_square_diameters():
    assert TABLE.standing_thrust(20.0, 1.2) == pytest.approx(-1.2 * 20.0**2 / 2 * 0.042 * 0.3**2, rel=1e-3)


def test_the_ends_of_the_table_belong_to_it():
    J, rpm = np.array([0.0, 0.8, 0.4, 0.4]), np.array([4500.0, 4500.0, 3000.0, 6000.0])
    assert TABLE.covers(J, rpm).all()
    assert not TABLE.covers(J + np.array([-0.01, 0.01, 0.0, 0.0]), rpm + np.array([0.0, 0.0, -1.0, 1.0])).any()


@pytest.mark.parametrize("J", [0.1, 0.5, 1.2])
@pytest.mark.parametrize("rpm", [2000.0, 3500.0, 5900.0, 7000.0])
def test_a_cell_is_the_table_within_its_sides(J, rpm):
    cells = TableCells(TABLE)
    cell = TableCell(0.3, "windmill", cells.numbers(cells.index(J, rpm)))
    assert cell.table(J, rpm) == pytest.approx(TABLE.table(J, rpm))


def test_uiuc_tests_at_speeds_a_twentieth_apart_stay_two_rows():
    text = "J CT CP eta\n0.1 0.1 0.05 0.2\n0.5 0.05 0.04 0.6\n"
    assert [row.rpm for row in parse_uiuc({5000.0: text, 5250.0: text}, "two", 0.25).rows] == [5000.0, 5250.0]


def test_points_measured_twice_at_one_J_are_averaged():
    low, high = (
        "J CT CP eta\n0.1 0.10 0.05 0.2\n0.3 0.08 0.05 0.5\n",
        "J CT CP eta\n0.3 0.06 0.04 0.5\n0.5 0.02 0.03 0.3\n",
    )
    (row,) = parse_uiuc({5000.0: low, 5010.0: high}, "twice", 0.25).rows
    assert row.J == (0.1, 0.3, 0.5)
    assert (row.cT[1], row.cP[1]) == pytest.approx((0.07, 0.045))


def test_a_uiuc_name_above_40_is_in_millimeters(tmp_path):
    """E-Flite 130x70 means 130 mm, and 10x5 means 10 in."""
    text = "J CT CP eta\n0.1 0.1 0.05 0.2\n0.5 0.05 0.04 0.6\n"
    for name, diameter_m in {"ef_130x70_0613od_5000.txt": 0.130, "apce_10x5_kt0821_5000.txt": 0.254}.items():
        (tmp_path / name).write_text(text)
        assert load_propeller(tmp_path / name).diameter_m == pytest.approx(diameter_m)


@pytest.mark.parametrize(("rpm", "standing"), [(4900.0, False), (4960.0, True), (6500.0, True), (8070.0, True),
                                               (8200.0, False)])  # fmt: skip
def test_a_row_within_a_hundredth_of_the_speeds_measured_without_wind_begins_there(rpm: float, standing: bool) -> None:
    row_text, static = (
        "J CT CP eta\n0.2 0.1 0.05 0.4\n0.4 0.08 0.05 0.6\n",
        "RPM CT CP\n5000 0.11 0.05\n8000 0.14 0.08\n",
    )
    (row,) = parse_uiuc({rpm: row_text}, "static", 0.25, static).rows
    assert (row.J[0] == 0.0) == standing
    if rpm == 6500.0:
        assert (row.cT[0], row.cP[0]) == pytest.approx((0.125, 0.065))
