"""Propeller tables: the files as they are downloaded, and the physics between and beyond their points."""

import csv
import re
from itertools import groupby
from operator import itemgetter
from pathlib import Path

import numpy as np
import pytest

from flightpower.flight.errors import InputError
from flightpower.flight.propeller import Propeller, Row
from flightpower.flight.propeller_files import load_propeller, parse_propeller, parse_uiuc

DATA = Path(__file__).parents[1] / "data" / "propellers"
SHIPPED = ("apc-10x5e", "apc-12x8e", "apc-12x8e-windmilling", "blade-11x5", "blade-16x10")
APC_HEAD = """\
         {size}                    ({size}.dat)                                  12/19/14

         ====== PERFORMANCE DATA (versus advance ratio and MPH) ======

         DEFINITIONS:
         J=V/nD (advance ratio)
         Ct=T/(rho * n**2 * D**4) (thrust coef.)
         Cp=P/(rho * n**3 * D**5) (power coef.)
         Pe=Ct*J/Cp (efficiency)
         V  (model speed in MPH)
"""
APC_BLOCK = """

         PROP RPM = {rpm:>10}

         V          J           Pe         Ct          Cp          PWR         Torque      Thrust
       (mph)     (Adv Ratio)                                       (Hp)        (In-Lbf)     (Lbf)
"""


def records(name: str) -> list[dict[str, str]]:
    lines = (DATA / name).read_text("utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


@pytest.fixture(scope="module")
def uiuc(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the 10x5's tables, named and written as UIUC's downloads are."""
    folder = tmp_path_factory.mktemp("uiuc")
    for test, points in groupby(records("uiuc-apce-10x5.csv"), key=itemgetter("test")):
        columns = ("rpm", "CT", "CP") if test.startswith("static") else ("J", "CT", "CP", "eta")
        table = [[point[column] for column in columns] for point in points]
        names = ["RPM" if name == "rpm" else name for name in columns]
        head = [name.ljust(len(cell)) for name, cell in zip(names, table[0], strict=True)]
        text = "".join("   ".join(line).rstrip() + "\n" for line in [head, *table])
        (folder / f"apce_10x5_{test}.txt").write_text(text, "utf-8")
    return folder


@pytest.fixture(scope="module")
def apc(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with computed tables, named and written as APC's downloads are."""
    folder = tmp_path_factory.mktemp("apc")
    for size, points in groupby(records("apc-computed.csv"), key=itemgetter("propeller")):
        text = APC_HEAD.format(size=size)
        for rpm, block in groupby(points, key=itemgetter("rpm")):
            text += APC_BLOCK.format(rpm=rpm)
            for point in block:
                text += "".join(f"{number:>12}" for number in list(point.values())[2:]) + "\n"
        (folder / f"PER3_{size}.dat").write_text("\r\n".join(f"{line:<110}" for line in text.splitlines()), "utf-8")
    return folder


def uiuc_tables(folder: Path) -> dict[float, str]:
    """The 10x5 in the wind tunnel, by speed of rotation, which is the number after the name's last underscore."""
    texts = {}
    for path in sorted(folder.glob("apce_10x5_*_????.txt")):
        rpm = re.search(r"_(\d{4})\.txt$", path.name)
        if rpm and "static" not in path.name:
            texts[float(rpm[1])] = path.read_text("utf-8")
    return texts


def test_uiuc_files_give_back_their_printed_values(uiuc):
    texts = uiuc_tables(uiuc)
    assert len(texts) >= 5
    propeller = parse_uiuc(texts, "apce 10x5", 0.254)
    # Seven tests at four speeds: two tests at one speed, for low and for high J, are one row at their mean speed.
    assert [row.rpm for row in propeller.rows] == [4005.0, 4996.5, 6011.5, 6708.5]
    by_rpm = {row.rpm: row for row in propeller.rows}
    for rpm, text in texts.items():
        row = by_rpm[min(by_rpm, key=lambda speed, rpm=rpm: abs(speed - rpm))]
        J, cT, cP, _ = np.loadtxt(text.splitlines()[1:], unpack=True)
        # Where both tests have a point at the same J to three decimals, the points are averaged; they agree to 0.0011.
        once = np.array([sum(f"\n{j:.3f} " in other for other in texts.values()) == 1 for j in J])
        coefficients = propeller.coefficients(J, row.rpm)
        assert np.allclose(np.array(coefficients)[:, once], np.array((cT, cP))[:, once], atol=1e-12)
        assert np.allclose(coefficients, (cT, cP), atol=0.0011)


def test_two_halves_of_one_speed_leave_no_hole_between_speeds(uiuc):
    """Rows of 4993 and 5000 rpm were once separate: just below them, cT at low J was that of the high-J half, 0.03."""
    propeller = load_propeller(uiuc / "apce_10x5_kt0821_5000.txt")
    cT, _ = propeller.coefficients(0.2, np.array([4005.0, 4500.0, 4980.0, 5000.0, 5500.0, 6005.0]))
    assert np.all(np.diff(cT) > -1e-4), "cT grows with Reynolds number here"
    assert 0.07 < cT.min() < cT.max() < 0.09


def test_uiuc_files_as_downloaded_give_diameter_static_thrust_and_all_speeds(uiuc):
    propeller = load_propeller(uiuc / "apce_10x5_kt0824_6018.txt")
    assert propeller.diameter_m == pytest.approx(0.254)
    assert len(propeller.rows) == 4
    static = np.loadtxt((uiuc / "apce_10x5_static_pg0819.txt").read_text("utf-8").splitlines()[1:])
    for row in propeller.rows:
        cT, cP = propeller.coefficients(0.0, row.rpm)
        assert float(cT) == pytest.approx(np.interp(row.rpm, static[:, 0], static[:, 1]), abs=1e-9)
        assert float(cP) == pytest.approx(np.interp(row.rpm, static[:, 0], static[:, 2]), abs=1e-9)
    assert parse_propeller(propeller.to_csv(), propeller.name).rows == propeller.rows


def test_between_tabulated_speeds_reynolds_number_is_followed(uiuc):
    """The row of 5000 rpm is left out and found from 4005 and 6010: within the tunnel's own 0.002 in cT and cP."""
    texts = uiuc_tables(uiuc)
    full_table = parse_uiuc(texts, "apce 10x5", 0.254)
    without = parse_uiuc({rpm: text for rpm, text in texts.items() if not 4900 < rpm < 5100}, "apce 10x5", 0.254)
    J = np.linspace(0.3, 0.65, 15)
    difference = np.array(without.coefficients(J, 4996.5)) - full_table.coefficients(J, 4996.5)
    nearest = np.array(full_table.coefficients(J, 6011.5)) - full_table.coefficients(J, 4996.5)
    assert np.max(np.abs(difference)) < 0.002
    assert np.sqrt(np.mean(difference**2)) < 0.5 * np.sqrt(np.mean(nearest**2)), "better than the next speed's row"


@pytest.mark.parametrize("name", ["PER3_12x8E.dat", "PER3_10x5E.dat"])
def test_apc_files_give_back_their_printed_coefficients(apc, name):
    text = (apc / name).read_text("utf-8", errors="replace")
    propeller = load_propeller(apc / name)
    checked, rpm = 0, 0.0
    for line in text.splitlines():
        heading = re.match(r"\s*PROP RPM\s*=\s*([\d.]+)", line)
        rpm = float(heading[1]) if heading else rpm
        columns = line.split()
        if rpm and len(columns) == 8 and re.fullmatch(r"[\d.]+", columns[0]):
            J, cT, cP = float(columns[1]), float(columns[3]), float(columns[4])
            assert np.array(propeller.coefficients(J, rpm)).tolist() == pytest.approx([cT, cP], abs=1e-9)
            checked += 1
    assert checked == 96


@pytest.mark.parametrize("name", ["PER3_12x8E.dat", "PER3_10x5E.dat"])
def test_apc_files_give_back_their_printed_thrust(apc, name):
    """The file prints thrust in pounds beside its coefficients, and (3.48) has to give the same thrust."""
    text = (apc / name).read_text("utf-8", errors="replace")
    propeller = parse_propeller(text, name)
    assert len(propeller.rows) == 6
    assert propeller.diameter_m == pytest.approx(float(re.match(r"\s*(\d+)x", text)[1]) * 0.0254)
    checked, rpm = 0, None
    for line in text.splitlines():
        heading = re.match(r"\s*PROP RPM\s*=\s*([\d.]+)", line)
        if heading:
            rpm = float(heading[1])
        columns = line.split()
        if rpm and 3000 <= rpm <= 9000 and len(columns) == 8 and re.fullmatch(r"[\d.]+", columns[0]):
            V_mph, thrust_N = float(columns[0]), float(columns[7]) * 4.4482216
            if thrust_N > 0.5:
                thrust, _ = propeller.thrust_and_power(V_mph * 0.44704, rpm / 60, 1.225)
                # J is printed to 0.01 and V to 0.1 mph, together 0.0065 of J; cT falls by up to 0.27 per unit of J.
                allowed = 0.0065 * 0.27 * 1.225 * (rpm / 60) ** 2 * propeller.diameter_m**4 + 0.0005 * 4.45
                assert thrust == pytest.approx(thrust_N, abs=allowed)
                checked += 1
    assert checked > 50


def test_two_sources_of_the_same_propeller_are_compared(apc):
    """The computed and the measured 10x5E differ by a good tenth, which is why a thrust scale has to be estimated."""
    measured = load_propeller("apc-10x5e")
    computed = parse_propeller((apc / "PER3_10x5E.dat").read_text("utf-8", errors="replace"), "10x5E")
    J = np.linspace(0.2, 0.45, 6)
    ratio = computed.coefficients(J, 6000)[0] / measured.coefficients(J, 6000)[0]
    assert np.all((ratio > 0.8) & (ratio < 1.35)), ratio


@pytest.mark.parametrize("name", SHIPPED)
def test_our_own_format_comes_back_the_same(name):
    propeller = load_propeller(name)
    again = parse_propeller(propeller.to_csv(), name)
    assert again.rows == propeller.rows
    assert again.diameter_m == propeller.diameter_m


@pytest.mark.parametrize("name", SHIPPED)
def test_interpolation_is_that_of_numpy(name):
    propeller = load_propeller(name)
    row = propeller.rows[1]
    J = np.linspace(0, row.J[-1], 77)
    cT, cP = propeller.coefficients(J, row.rpm)
    assert np.allclose(cT, np.interp(J, row.J, row.cT), atol=1e-12)
    assert np.allclose(cP, np.interp(J, row.J, row.cP), atol=1e-12)
    between = (propeller.rows[1].rpm + propeller.rows[2].rpm) / 2
    mean = (
        np.array(propeller.coefficients(0.3, propeller.rows[1].rpm))
        + propeller.coefficients(0.3, propeller.rows[2].rpm)
    ) / 2
    assert np.allclose(propeller.coefficients(0.3, between), mean)


@pytest.mark.parametrize("name", SHIPPED)
def test_beyond_zero_thrust_the_propeller_brakes_and_then_windmills(name):
    propeller = load_propeller(name)
    n = 80.0
    V = np.linspace(0.3, 1.6, 40) * n * propeller.diameter_m
    thrust, power = propeller.thrust_and_power(V, n, 1.2)
    # Below zero thrust the propeller still takes power; further on the air turns it. It is never the other way round.
    assert thrust[0] > 0 > thrust[-1]
    assert power[0] > 0 > power[-1]
    assert V[np.argmax(thrust < 0)] <= V[np.argmax(power < 0)]
    # A propeller cannot give more than it takes.
    driving = (thrust > 0) & (power > 0)
    assert np.all(thrust[driving] * V[driving] < power[driving])


def test_symbols_pass_through_unchanged():
    ca = pytest.importorskip("casadi")
    ca.GlobalOptions.setNumpyMode(-1)
    propeller = load_propeller("apc-12x8e")
    V, n = ca.SX.sym("V"), ca.SX.sym("n")
    f = ca.Function("f", [V, n], list(propeller.thrust_and_power(V, n, 1.2)))
    for point in ((0.0, 50.0), (17.0, 95.0), (30.0, 60.0), (25.0, 190.0)):
        assert np.allclose([float(x) for x in f(*point)], propeller.thrust_and_power(*point, 1.2), rtol=1e-12)


def test_covers_knows_the_table():
    propeller = Propeller(
        "p", 0.3, (Row(4000, (0.0, 0.8), (0.1, 0.0), (0.05, 0.01)), Row(6000, (0.0, 0.9), (0.1, 0.0), (0.05, 0.01)))
    )
    J, rpm = np.array([0.5, 0.84, 0.88, 0.5, 0.5]), np.array([5000, 5000, 5000, 3000, 7000])
    assert propeller.covers(J, rpm).tolist() == [True, True, False, False, False]


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("rpm,J,cT,cP\n5000,0,0.1,0.04\n", "diameter_m"),
        ("# diameter_m = 0.3\nrpm,J,cT\n5000,0,0.1\n", "rpm,J,cT,cP: no cP in the header 'rpm,J,cT'"),
        ("# diameter_m = 0.3\nrpm;J;cT;cP\n5000;0;0.1;0.1\n", "no rpm, J, cT, cP in the header 'rpm;J;cT;cP'"),
        ("# diameter_m = 11\nrpm,J,cT,cP\n5000,0,0.1,0.04\n5000,0.5,0.1,0.04\n", "diameter_m = 11 .* inch is 0.0254"),
        ("# diameter_m = 0.3\nrpm,J,cT,cP\n5000,0,x,0.04\n", "rpm,J,cT,cP"),
        ("# diameter_m = 0.3\nrpm,J,cT,cP\n", "empty"),
        ("# diameter_m = 0.3\nrpm,J,cT,cP\n5000,0,0.1,0.04\n", "two points"),
        ("# diameter_m = 0.3.5\nrpm,J,cT,cP\n5000,0,0.1,0.04\n", "diameter_m = 0.3.5 is not a number"),
        ("# diameter_m = 0\nrpm,J,cT,cP\n5000,0,0.1,0.04\n5000,0.5,0.1,0.04\n", "a diameter of 0 m"),
        (
            "# diameter_m = 0.3\nrpm,J,cT,cP\n5000,0,0.1,0.04\n5000,nan,0.1,0.04\n",
            "a number at 5000 rpm is impossible for a propeller",
        ),
        (
            "# diameter_m = 0.3\nrpm,J,cT,cP\n5000,0,0.1,0.04\n5000,.5,1e300,.04\n",
            "a number at 5000 rpm is impossible for a propeller",
        ),
        ("# diameter_m = 0.3\nrpm,J,cT,cP\n5000,0,.1,.04\n5000,1e-320,.2,.04\n", "two points with ascending J"),
    ],
)
def test_a_broken_table_is_refused_by_name(text, cause):
    with pytest.raises(InputError, match=rf"propeller mine.*{cause}"):
        parse_propeller(text, "mine")


def test_an_unknown_propeller_says_what_lists_those_there_are():
    with pytest.raises(InputError, match=r"apc-99x99: neither a file nor .*`flightpower propellers 99x99` lists"):
        load_propeller("apc-99x99")


def test_the_error_of_the_continuation_grows_with_the_distance_beyond_the_table():
    """The error is 0 inside the table; outside it is 5 % of the change of thrust plus 4 % for each 0.1: 9 % at 0.1, 17
    % at 0.3."""
    table = Propeller("two", 0.3, (Row(4000, (0.2, 0.6, 0.8), (0.1, 0.04, 0.0), (0.05, 0.03, 0.005)),))
    J = np.array([0.1, 0.5, 0.8, 0.9, 1.1])
    error = table.continuation_error(J, 4000.0)
    assert (error[:3] == 0).all()
    change = np.abs(table.coefficients(J, 4000.0)[0])
    assert error[3:] / change[3:] == pytest.approx([0.09, 0.17])
    assert (table.with_beyond_zero_thrust("fold").continuation_error(J, 4000.0) == 0).all(), (
        "folded blades do not brake"
    )
