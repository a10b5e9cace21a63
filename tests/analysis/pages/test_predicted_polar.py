"""Polars that other programs predicted: read as they write them, and drawn where the flight was."""

from pathlib import Path

import numpy as np
import pytest

from analysis.curve import Polar, power_required
from analysis.pages.charts import power
from analysis.pages.predicted_polar import comparison, flown_at, read_predicted_polar
from analysis.records.flight import Results
from flight.errors import InputError

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


def test_the_power_of_a_parabola_is_that_of_the_measured_polar(tmp_path: Path, results: Results) -> None:
    """Of the same polar, the prediction lies on the curve; with a tenth more drag, 10 % above it."""
    at, CL = flown_at(results), np.linspace(0.05, 1.5, 400)
    A = np.array([0.045, 0.0, 0.065])
    for more in (1.0, 1.1):
        rows = "".join(f"{one:.6f} {more * (A[0] + A[2] * one**2):.8f}\n" for one in CL)
        polar = read_predicted_polar(written(tmp_path, "CL CD\n" + rows))
        V = np.linspace(13.0, 24.0, 9)
        expected, _ = power_required(V, Polar(A, np.zeros((3, 3))), at)
        assert polar.power_W(V, at) == pytest.approx(more * expected, rel=1e-4)
        (line,) = [one for one in power.power_required(results, polar).marks if "plane.txt" in one.name]
        inside = np.isfinite(line.y)
        drawn, _ = power_required(line.x[inside], Polar(A, np.zeros((3, 3))), at)
        assert line.y[inside] == pytest.approx(more * drawn, rel=1e-3)


def test_the_report_says_how_far_off_the_prediction_is_and_where_it_ends(tmp_path: Path, results: Results) -> None:
    at = flown_at(results)
    V, P = np.array([(one.speed_mps, one.power_W) for one in results.power_required]).T
    CL, CD = 2 * at.weight_N / (at.rho * V**2 * at.wing_area_m2), P / (at.rho / 2 * V**3 * at.wing_area_m2)

    def said(rows: slice) -> str:
        table = "".join(f"{float(x)!r} {1.2 * float(y)!r}\n" for x, y in zip(CL[rows], CD[rows], strict=True))
        return comparison(read_predicted_polar(written(tmp_path, "CL CD\n" + table)), results)

    assert "+20 to +20 % from the measured curve, at" in said(slice(None))
    assert f"between {V[2]:.1f} and {V[8]:.1f} m/s" in said(slice(2, 9))
    low = read_predicted_polar(written(tmp_path, "CL CD\n0.01 0.02\n0.02 0.02\n0.03 0.02\n"))
    assert "predicts nothing at the speeds flown" in comparison(low, results)
    assert "plane.txt" in [
        one.name.split(", ")[-1]
        for one in power.drag_polar(Polar(np.array([0.045, 0.0, 0.065]), np.eye(3) * 1e-9), (0.2, 0.9), low).marks
        if "predicted" in one.name
    ]
