"""Polars that other programs predicted: read as they write them, and drawn where the flight was."""

from pathlib import Path

import numpy as np
import pytest

from flightpower.analysis.curve import Polar, power_required
from flightpower.analysis.pages.charts import power
from flightpower.analysis.pages.predicted_polar import (
    PredictedPolar,
    check_of_aircraft,
    comparison,
    flown_at,
    read_predicted_polar,
)
from flightpower.analysis.pages.write import write_report
from flightpower.analysis.pipeline.runs import Analysis
from flightpower.analysis.records.flight import Results
from flightpower.flight.errors import InputError

# As XFLR5 6 exports the polar of a plane. The wing stalls after the fourth point; Cl is the rolling moment.
XFLR5 = """xflr5 v6.47

 Calculated polar for: T1-12.0 m/s-VLM2

   alpha     Beta       CL          CDi        CDv        CD         CY         Cl         Cm         QInf
  -4.000    0.000  -0.100000   0.000700   0.020000   0.020700   0.000000   0.900000   0.010000    12.0000
   0.000    0.000   0.250000   0.002000   0.021000   0.023000   0.000000   0.900000  -0.010000    12.0000
   4.000    0.000   0.600000   0.011000   0.024000   0.035000   0.000000   0.900000  -0.040000    12.0000
   8.000    0.000   0.900000   0.027000   0.033000   0.060000   0.000000   0.900000  -0.060000    12.0000
  12.000    0.000   0.850000   0.025000   0.115000   0.140000   0.000000   0.900000  -0.080000    12.0000
"""
AVL = """ Vortex Lattice Output -- Total Forces
  Sref =  0.46        Cref =  0.28        Bref =   1.70
  CXtot =  -0.01030     Cltot =  -0.00000     Cl'tot =  -0.00000
  CLtot =   {CL:.5f}
  CDtot =   {CD:.5f}
  CDvis =   0.02000     CDind = 0.00300
"""
POINTS = [(-0.1, 0.0207), (0.25, 0.023), (0.6, 0.035), (0.9, 0.06)]


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "plane.txt"
    path.write_text(text, "utf-8")
    return path


@pytest.mark.parametrize(
    "text",
    [
        XFLR5,
        "\n".join(",".join(line.split()) for line in XFLR5.splitlines()[4:]),
        "".join(AVL.format(CL=CL, CD=CD) for CL, CD in reversed(POINTS)),
        ",alpha,CL,CD\n" + "".join(f"{i},{i},{CL},{CD}\n" for i, (CL, CD) in enumerate(POINTS)),
        '"CD";"CL"\n' + "".join(f"{CD};{CL}\n" for CL, CD in reversed(POINTS)),
        "alpha CL ICd PCd TCd CY\n" + "".join(f"1 {CL} 0 0 {CD} 0\n" for CL, CD in POINTS),
    ],
    ids=["XFLR5", "XFLR5 as CSV", "AVL, cases in any order", "pandas", "semicolons, downward", "XFLR5 of old"],
)
def test_lift_and_drag_up_to_the_stall(tmp_path: Path, text: str) -> None:
    polar = read_predicted_polar(written(tmp_path, text))
    assert [*zip(polar.CL, polar.CD, strict=True)] == POINTS


@pytest.mark.parametrize(
    "text",
    ["", "t,V\n0,1\n1,2\n", "CL CD\n0.2 0.03\n0.4 0.04\n", "CL CD\n0.2 0.03\n0.4 -0.04\n0.6 0.05\n",
     "CL CD\nnan nan\nx y\n"],
)  # fmt: skip
def test_what_is_no_polar_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError, match="plane"):
        read_predicted_polar(written(tmp_path, text))
    with pytest.raises(InputError, match="missing"):
        read_predicted_polar(tmp_path / "missing.txt")


XFOIL = """       XFOIL         Version 6.99

 Calculated polar for: NACA 2412

 xtrf =   1.000 (top)        1.000 (bottom)
 Mach =   0.000     Re =     0.300 e 6     Ncrit =   9.000

   alpha    CL        CD       CDp       CM     Top_Xtr  Bot_Xtr
  ------ -------- --------- --------- -------- -------- --------
   0.000   0.2300   0.00800   0.00200  -0.0500   0.6000   0.9000
   4.000   0.6600   0.00900   0.00300  -0.0500   0.5000   1.0000
   8.000   1.0500   0.01500   0.00700  -0.0400   0.2000   1.0000
"""


@pytest.mark.parametrize(
    "text",
    [
        XFOIL,
        XFOIL.replace("xtrf =   1.000 (top)        1.000 (bottom)", "").replace("Top_Xtr  Bot_Xtr", "Top Xtr Bot Xtr"),
        "alpha,CL,CD,CM,Top_Xtr,Bot_Xtr\n0,0.2,0.008,-0.05,0.6,1\n4,0.6,0.009,-0.05,0.5,1\n8,1,0.015,0,0.2,1\n",
    ],
    ids=["XFOIL", "XFLR5, of an airfoil", "AeroSandbox, of an airfoil"],
)
def test_the_polar_of_an_airfoil_is_refused_by_its_transition(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError, match=r"plane.txt: the polar of an airfoil, which has no induced drag; export"):
        read_predicted_polar(written(tmp_path, text))


def test_drag_below_the_least_induced_drag_of_the_span_is_refused(tmp_path: Path) -> None:
    """A table with only lift and drag: elliptic lift alone costs C_L^2/(pi AR) whatever the airfoil, and a polar with
    less drag is refused."""
    aspect_ratio = 6.6
    CL = np.linspace(-0.2, 1.2, 15)

    def polar(least: float, share: float) -> PredictedPolar:
        rows = "".join(f"{x:.6f} {least + share * x**2 / (np.pi * aspect_ratio):.8f}\n" for x in CL)
        return read_predicted_polar(written(tmp_path, "cl cd\n" + rows))

    check_of_aircraft(polar(0.001, 1.0), aspect_ratio)
    check_of_aircraft(polar(0.03, 0.8), aspect_ratio)
    with pytest.raises(InputError, match=r"plane.txt: its drag coefficient of 0\.0100 at a lift coefficient of 1\.20"):
        check_of_aircraft(polar(0.010, 0.0), aspect_ratio)
    with pytest.raises(InputError, match="induced drag of this span alone"):
        check_of_aircraft(polar(0.008, 0.7), aspect_ratio)


def test_the_power_of_a_parabola_is_that_of_the_measured_polar(tmp_path: Path, results: Results) -> None:
    """Predicted from the measured polar, power lies on the curve; with a tenth more drag, 10 % above it."""
    condition, CL = flown_at(results), np.linspace(0.05, 1.5, 400)
    A = np.array([0.045, 0.0, 0.065])
    for more in (1.0, 1.1):
        rows = "".join(f"{item:.6f} {more * (A[0] + A[2] * item**2):.8f}\n" for item in CL)
        polar = read_predicted_polar(written(tmp_path, "CL CD\n" + rows))
        V = np.linspace(13.0, 24.0, 9)
        expected, _ = power_required(V, Polar(A, np.zeros((3, 3))), condition)
        assert polar.power_W(V, condition) == pytest.approx(more * expected, rel=1e-4)
        (line,) = [mark for mark in power.power_required(results, polar).marks if "plane.txt" in mark.name]
        inside = np.isfinite(line.y)
        power_W, _ = power_required(line.x[inside], Polar(A, np.zeros((3, 3))), condition)
        assert line.y[inside] == pytest.approx(more * power_W, rel=1e-3)


def test_no_report_is_written_with_the_polar_of_an_airfoil(tmp_path: Path, results: Results) -> None:
    thin = read_predicted_polar(written(tmp_path, "CL CD\n0.2 0.008\n0.6 0.009\n1.0 0.015\n"))
    analysis = object.__new__(Analysis)  # only its results are used
    object.__setattr__(analysis, "results", results)
    with pytest.raises(InputError, match="induced drag of this span alone"):
        write_report(analysis, tmp_path / "report", thin)
    assert not (tmp_path / "report").exists()


def test_the_report_says_how_far_off_the_prediction_is_and_where_it_ends(tmp_path: Path, results: Results) -> None:
    condition = flown_at(results)
    V, P = np.array([(item.speed_mps, item.power_W) for item in results.power_required]).T
    CL, CD = (
        2 * condition.weight_N / (condition.rho * V**2 * condition.wing_area_m2),
        P / (condition.rho / 2 * V**3 * condition.wing_area_m2),
    )

    def sentence_for(rows: slice) -> str:
        table = "".join(f"{float(x)!r} {1.2 * float(y)!r}\n" for x, y in zip(CL[rows], CD[rows], strict=True))
        return comparison(read_predicted_polar(written(tmp_path, "CL CD\n" + table)), results)

    assert "+20 to +20 % from the measured curve, at" in sentence_for(slice(None))
    assert f"between {V[2]:.1f} and {V[8]:.1f} m/s" in sentence_for(slice(2, 9))
    low = read_predicted_polar(written(tmp_path, "CL CD\n0.01 0.02\n0.02 0.02\n0.03 0.02\n"))
    assert "predicts nothing at the speeds flown" in comparison(low, results)
    assert "plane.txt" in [
        mark.name.split(", ")[-1]
        for mark in power.drag_polar(Polar(np.array([0.045, 0.0, 0.065]), np.eye(3) * 1e-9), (0.2, 0.9), low).marks
        if "predicted" in mark.name
    ]
