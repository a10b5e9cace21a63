"""The shipped tables are what their headers say, and the stated error of using another table contains the actual
error."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flightpower.daq.attachments import propeller_text
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.errors import InputError
from flightpower.flight.propeller import Origin
from flightpower.flight.propeller_files import load_propeller, parse_propeller
from flightpower.flight.propeller_search import (
    Query,
    Table,
    cost_of,
    described,
    flight_J,
    matching,
    nearest,
    parse_query,
    shipped_tables,
    tables_in,
    with_table_error,
)
from flightpower.flight.shipped_propellers import shipped_propellers

TABLES = shipped_tables()
MEASURED = [table for table in TABLES if table.origin is Origin.MEASURED]


def named(name: str) -> Table:
    return next(table for table in TABLES if table.name == name)


@pytest.mark.parametrize("table", TABLES, ids=lambda item: item.name)
def test_a_shipped_table_says_what_it_is_of_and_is_a_propeller(table: Table) -> None:
    assert table.series and table.published and table.blades == 2 and table.origin is not Origin.UNKNOWN
    assert table.size in table.name, "the name has the size"
    assert ("computed" in table.name) <= (table.origin is Origin.COMPUTED)
    if table.origin is Origin.MEASURED:
        assert "propDB.html" in table.propeller.source or table.name == "apc-10x5e"
        assert len(table.propeller.rows) > 1, "Reynolds number is followed"
    for row in table.propeller.rows:
        J, cT, cP = (np.array(column) for column in (row.J, row.cT, row.cP))
        driven = cT > 0.002
        assert (J * cT / cP)[driven].max() < (0.8 if table.origin is Origin.MEASURED else 0.9), (
            "no small one is more efficient"
        )
        # No point is far from the line through its neighbors, as a mistyped or misplaced point would be.
        line = cT[:-2] + (cT[2:] - cT[:-2]) * (J[1:-1] - J[:-2]) / (J[2:] - J[:-2])
        assert np.abs(line - cT[1:-1]).max() < 0.1 * cT.max()
        # Below the J of its pitch, where the blades have no angle of attack, a propeller pulls.
        assert table.pitch_in and cT[0.5 * table.pitch_in / table.diameter_in > J].min(initial=1) > 0


def test_a_table_with_a_dot_in_its_name_is_found() -> None:
    assert "apc-11x5.5e" in shipped_propellers()
    assert load_propeller("apc-11x5.5e").diameter_m == pytest.approx(11 * 0.0254)
    assert propeller_text("apc-11x5.5e").startswith("# APC 11x5.5E")  # what the recorder attaches


APC_FILE = """         {name}      (PER3_{name}.dat)

         PROP RPM =        {rpm}
  V  J  Pe  Ct  Cp  PWR  Torque  Thrust
  0.0  0.00  0.00  0.10  0.04  0.01  0.1  0.1
  9.0  0.30  0.60  0.07  0.035  0.01  0.1  0.1
 18.0  0.60  0.70  0.01  0.010  0.01  0.1  0.1
"""


@pytest.mark.parametrize(
    ("name", "pitch_in", "blades"),
    [
        ("10x5E", 5.0, 2),
        ("10x5(F2B)", 5.0, 2),
        ("15x11(WCAR-T6)", 11.0, 2),
        ("9x6(3 of 4)-3", 6.0, 3),
        ("13x8E-3", 8.0, 3),
        ("10x5-3(F2B)", 5.0, 3),
        ("4.1x4.1E-B4", 4.1, 4),
        ("20.5x18R2-L", 18.0, 2),
    ],
)
def test_a_name_of_apc_says_pitch_and_blades_also_with_brackets(
    name: str, pitch_in: float, blades: int, tmp_path: Path
) -> None:
    """Text in brackets says what the propeller is for; digits there are neither a size nor blades."""
    text = "".join(APC_FILE.format(name=name, rpm=rpm) if rpm == 3000 else
                   APC_FILE.format(name=name, rpm=rpm).partition("\n")[2] for rpm in (3000, 6000))  # fmt: skip
    (tmp_path / f"PER3_{name}.dat").write_text(text, "utf-8")
    (result,), problems = tables_in(tmp_path)
    assert not problems and (result.pitch_in, result.blades) == (pitch_in, blades)
    assert result.propeller.origin is parse_propeller(result.propeller.to_csv(), name).origin is Origin.COMPUTED
    assert matching([result], parse_query([name.split("(")[0].split("E")[0].split("R")[0]])) == [result]
    assert matching([result], parse_query([name])) == [result]


def test_words_sizes_and_diameters_are_found() -> None:
    assert [table.name for table in matching(TABLES, parse_query(["11X7E"]))] == ["apc-11x7e", "apc-11x7e-computed"]
    assert [table.size for table in matching(TABLES, parse_query(["Graupner", "11"]))] == ["11x6", "11x8"]
    assert {table.origin for table in matching(TABLES, parse_query(["11x7"]))} == {Origin.MEASURED, Origin.COMPUTED}
    assert matching(TABLES, parse_query([])) and len(matching(TABLES, parse_query([]))) == len(TABLES)
    assert not matching(TABLES, parse_query(["11x7.2"]))


@pytest.mark.parametrize(
    ("words", "message"), [(["11x7", "12"], "a size was given before"), (["280x180"], "in inches")]
)
def test_a_wrong_size_is_refused(words: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_query(words)


def test_the_nearest_are_near_in_both_dimensions_and_one_is_measured() -> None:
    assert nearest(TABLES, parse_query(["11x7.2"]))[0].size == "11x7"
    result = nearest(TABLES, parse_query(["13x7"]))
    assert result[0].size == "13x6.5" and result[0].origin is Origin.COMPUTED
    assert any(item.origin is Origin.MEASURED for item in result)
    assert all("graupner" in item.name for item in nearest(TABLES, parse_query(["11x7", "graupner"])))


def thrust_ratio(base: Table, other: Table, J: tuple[float, float]) -> float:
    """Mean logarithm of the ratio of two tables' thrusts [N] at equal airspeeds and one speed of rotation."""
    rpm = np.clip(np.mean(base.rpm), *other.rpm)
    n, V = rpm / 60, np.linspace(*J, 15) * rpm / 60 * base.propeller.diameter_m
    item, two = (table.propeller.thrust_and_power(V, np.full(V.shape, n), 1.2)[0] for table in (base, other))
    return float(np.mean(np.log(np.maximum(two / item, 0.05))))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "least"), [pytest.param(("nobody",), 27, marks=pytest.mark.thorough), (("apc", "thin"), 12)]
)
def test_each_measured_table_as_if_it_were_missing_lies_in_the_interval_said(
    words: tuple[str, ...], least: int
) -> None:
    """The interval holds for 95 % of the 29 tables of any make, and for 12 of the 13 of one series."""
    inside, scale_z = 0, []
    requests = [table for table in MEASURED if words == ("nobody",) or table.series == "APC thin electric"]
    for left_out in requests:
        rest = [table for table in TABLES if (table.series, table.size) != (left_out.series, left_out.size)]
        query = Query(words, left_out.diameter_in, left_out.pitch_in)
        base = next(item for item in nearest(rest, query) if item.origin is Origin.MEASURED)
        cost = cost_of(base, query, rest)
        ratio = thrust_ratio(base, left_out, cost.J)
        inside += cost.thrust[0] <= math.expm1(ratio) <= cost.thrust[1]
        scale_z.append(ratio / math.log1p(cost.thrust_scale))
    assert inside >= least
    assert 0.3 < np.sqrt(np.mean(np.square(scale_z))) < 1.2, "neither too small nor useless"


def test_an_inch_of_diameter_and_pitch_cost_what_physics_says() -> None:
    """At one airspeed, thrust grows with D^4 and more, since a larger diameter lowers J; with pitch it grows less."""
    cost = cost_of(named("apc-11x7e"), parse_query(["11x7.5", "apc", "thin"]), TABLES)
    assert cost.per_inch
    in_powers = [math.log1p(step) / math.log1p(1 / inch) for step, inch in zip(cost.per_inch, (11, 7), strict=True)]
    assert 2.5 < in_powers[0] < 5 and 1 < in_powers[1] < 3
    near, far = (
        cost_of(named("apc-11x7e"), parse_query([size, "apc", "thin"]), TABLES) for size in ("11x7.2", "11x8.2")
    )
    assert 0.018 < near.thrust_scale < far.thrust_scale


def test_a_computed_table_is_said_to_be_off_as_much_as_computed_ones_were_found() -> None:
    query = parse_query(["13x8"])
    base = nearest(TABLES, query)[0]
    cost = cost_of(base, query, TABLES)
    results = []
    for computed in (table for table in TABLES if table.name.endswith("-computed")):
        for measured in MEASURED:
            if (measured.series, measured.size) == (computed.series, computed.size):
                results.append(math.expm1(thrust_ratio(computed, measured, flight_J(computed))))
    assert cost.compared == len(results) == 18 and cost.per_inch is None
    assert cost.thrust[0] < min(results) < -0.1 and max(results) < cost.thrust[1]
    assert cost.thrust_scale > 0.1 and cost.thrust_slope > 0.3
    of_measured = cost_of(named("apc-11x7e"), parse_query(["11x7"]), TABLES)
    assert of_measured.thrust == (0, 0) and of_measured.thrust_scale == pytest.approx(0.018)


def test_at_advance_ratios_that_no_table_has_nothing_is_reported() -> None:
    with pytest.raises(InputError, match="too few measured tables"):
        cost_of(named("apc-11x7e"), parse_query(["11x7.5"]), TABLES, (2.0, 3.0))


def test_a_table_written_and_read_is_the_same() -> None:
    for table in (named("apc-11x5.5e"), named("apc-13x8e-computed")):
        again = described(table.name, parse_propeller(table.to_csv(), table.name))
        assert again.propeller.rows == table.propeller.rows and again.size == table.size
        assert (again.series, again.origin, again.published, again.blades) == (
            table.series, table.origin, table.published, table.blades,
        )  # fmt: skip
        assert again.to_csv() == table.to_csv()


def test_a_computed_table_is_as_uncertain_as_others_that_were_measured_too() -> None:
    """It has 17 % of thrust and 0.58 of its slope, unless the aircraft file states them; a measured table is
    unchanged."""
    computed, measured = named("apc-10x5e-computed").propeller, named("apc-10x5e").propeller
    usual = Uncertainty()
    result, note = with_table_error(usual, (), computed)
    assert (result.thrust_scale_fraction, result.thrust_slope) == pytest.approx((0.17, 0.58), abs=0.01)
    assert replace(result, thrust_scale_fraction=0.018, thrust_slope=0.15) == usual and "17 %" in note
    uncertainty, note = with_table_error(usual, ("uncertainty.thrust_scale",), computed)
    assert (uncertainty.thrust_scale_fraction, uncertainty.thrust_slope) == pytest.approx(
        (0.018, 0.58), abs=0.01
    ) and note
    both = ("uncertainty.thrust_scale", "uncertainty.thrust_slope")
    for stated_keys, table in ((both, computed), ((), measured), ((), named("blade-16x10").propeller)):
        assert with_table_error(usual, stated_keys, table) == (usual, "")


def test_a_table_says_where_it_comes_from_or_that_it_does_not() -> None:
    text = "# diameter_m = 0.3\nrpm,J,cT,cP\n5000,0.0,0.1,0.04\n5000,0.5,0.05,0.03\n"
    assert parse_propeller(text, "mine").origin is Origin.UNKNOWN
    assert parse_propeller(f"# origin = measured\n{text}", "mine").origin is Origin.MEASURED
    assert parse_propeller(f"# origin = a friend\n{text}", "mine").origin is Origin.UNKNOWN
