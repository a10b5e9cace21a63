"""The report of electrical power: its page, figures and files."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.files import write_file
from analysis.methods.whole_flight.curve import ElectricalEstimate
from analysis.methods.whole_flight.fit import samples_of
from analysis.methods.whole_flight.flight_table import FlightTable
from analysis.methods.whole_flight.settings import CURVE
from analysis.pages.answers import HeadlineAnswer, interval_text, optimum_remark
from analysis.pages.charts.style import (
    BLUE,
    GRAY,
    INK,
    Figure,
    add_band,
    add_curve,
    curve_arrays,
    rounded,
    styled,
    thinned,
)
from analysis.pages.html_page import HtmlTable, html_figure, render_page
from analysis.pages.sections.flight import electrical_facts
from analysis.pages.sections.performance import autopilot_section
from analysis.pages.wording import every, verdict
from analysis.records.flight import ElectricalResult, Results, SpeedInterval
from analysis.results.files import to_csv, to_json
from analysis.results.previous import replaced
from flight.units import GRAVITY_MPS2

NOTHING_AGAINST = "Nothing speaks against this flight."


def write_electrical_report(results: Results, flight: FlightTable, estimate: ElectricalEstimate, folder: Path) -> str:
    """Write report.html, results.json and electrical_power.csv. Raises InputError when the folder cannot be written.

    Returns what of another log or of other options they replaced, in a sentence.
    """
    files: dict[str, str | bytes] = {"results.json": to_json(results), "electrical_power.csv": to_csv(results)}
    before = replaced(folder, results, files)
    files["report.html"] = _page(results, flight, estimate, before)
    for name, content in files.items():
        write_file(folder / name, content)
    return before


def electrical_answers(results: Results) -> list[HeadlineAnswer]:
    """Speeds of longest endurance and range, with both where the battery is known."""
    found = results.electrical
    if found is None:
        return []
    power = {round(p.speed_mps, 6): p for p in results.electrical_power}

    def note(speed_mps: float | None, on_battery: str) -> str:
        point = power.get(round(speed_mps or 0.0, 6))
        taken = f"{point.power_W:.0f} W ({point.power_lo_W:.0f} to {point.power_hi_W:.0f})" if point else ""
        below = (
            " Power may still fall below it: slower flight was too short to tell."
            if _at_slowest(speed_mps, results)
            else ""
        )
        return f"{taken}{on_battery}, in still air.{below}"

    endurance = f", {interval_text(found.endurance_s.times(1 / 60), 'min', 0)}" if found.endurance_s else ""
    distance = f", {interval_text(found.range_m.times(1e-3), 'km', 1)}" if found.range_m else ""
    return [
        HeadlineAnswer(question, _speed_remark(speed, results), note(speed.speed_mps, on_battery), speed.speed_mps)
        for question, speed, on_battery in (
            ("Longest endurance", found.least_power_speed, endurance),
            ("Longest range", found.best_range_speed, distance),
        )
    ]


def _speed_remark(best: SpeedInterval, results: Results) -> str:
    """At an end of the speeds flown the best speed may lie outside them."""
    if best.inside_flown_range or best.speed_mps is None:
        return optimum_remark(best)
    return f", the {'slowest' if _at_slowest(best.speed_mps, results) else 'fastest'} of the curve"


def _at_slowest(speed_mps: float | None, results: Results) -> bool:
    return speed_mps is not None and speed_mps <= results.electrical_power[0].speed_mps


def _page(results: Results, flight: FlightTable, estimate: ElectricalEstimate, before: str) -> str:
    found = results.electrical
    assert found is not None
    errors = estimate.airspeed
    V = samples_of(flight, errors.scale, errors.zero_Pa, errors.wind).V_mps
    drawn = {
        "power": electrical_power(results, estimate),
        "flight": flight_figure(flight, V),
        "residuals": residuals(estimate),
    }
    return render_page(
        "electrical.html",
        title=f"{results.aircraft.title}: electrical power",
        condition=(
            f"{results.test.weight_N / GRAVITY_MPS2:.2f} kg, air {results.test.air_density_kgpm3:.3f} kg/m³"
            f" ({results.air_temperature_K - 273.15:.0f} °C); from {found.flown_s / 60:.1f} min in the air"
        ),
        verdict=verdict(results.trust, results.evidence, NOTHING_AGAINST),
        hardly_flown=CURVE.percentiles[0],
        cards=electrical_answers(results),
        warnings=results.warnings,
        curve=curve_table(results),
        shared_part=_shared_part(found),
        withheld=found.withheld,
        autopilot=autopilot_section(results),
        drag=_drag_table(results),
        thrust_basis=found.thrust_basis,
        air=_air(found),
        balance=(
            f"Useful power less that of drag and of the change of energy, {found.residual_W:.0f} W rms over"
            f" {found.flown_s:.0f} s. Vertical motion of the air appears here; slow waves do so too, and the interval"
            " contains them."
        ),
        facts=electrical_facts(results),
        source=f"flightpower {results.software_version}, from {results.log}",
        replaced=before,
        figures={name: html_figure(figure, name) for name, figure in drawn.items()},
    )


def curve_table(results: Results) -> HtmlTable:
    return HtmlTable(
        ("speed, m/s", "power, W", "95 % interval, W"),
        [
            (f"{p.speed_mps:.1f}", f"{p.power_W:.0f}", f"{p.power_lo_W:.0f} to {p.power_hi_W:.0f}")
            for p in every(results.electrical_power)
        ],
        numbers=True,
    )


def _drag_table(results: Results) -> HtmlTable | None:
    """None where thrust is not known."""
    required, found = results.power_required, results.electrical
    if not required or found is None:
        return None
    shaft = {p.speed_mps: p for p in found.shaft_power}
    return HtmlTable(
        ("speed, m/s", "power required, W", "95 % interval, W", "drag, N", "shaft power, W"),
        [
            (
                f"{p.speed_mps:.1f}", f"{p.power_W:.0f}", f"{p.power_lo_W:.0f} to {p.power_hi_W:.0f}",
                f"{p.power_W / p.speed_mps:.2f}",
                f"{shaft[p.speed_mps].power_W:.0f}" if p.speed_mps in shaft else "",
            )
            for p in every(required)
        ],
        numbers=True,
    )  # fmt: skip


def _shared_part(found: ElectricalResult) -> str:
    middle = found.interval_parts[len(found.interval_parts) // 2]
    whole = float(np.hypot(middle.noise_W, middle.systematic_W))
    return (
        f"At {middle.speed_mps:.0f} m/s the half width of the interval is {whole:.0f} W: {middle.noise_W:.0f} W by air"
        " motion and what the flight does not tell apart, which a longer flight reduces, and"
        f" {middle.systematic_W:.0f} W by what the whole flight shares: airspeed, current meter, mass, density."
    )


def _air(found: ElectricalResult) -> str:
    if found.airspeed_scale is None:
        wind = f"Wind {found.wind_mps:.1f} m/s from {found.wind_from_deg:.0f} deg"
        return f"{wind}; airspeed is the velocity by GPS less the wind."
    if found.wind_mps is None or found.wind_from_deg is None:
        return "Without GPS neither wind nor the error of the airspeed is known."
    return (
        f"Wind {found.wind_mps:.1f} m/s from {found.wind_from_deg:.0f} deg. The airspeed in the log differs from the"
        f" true one by {100 * found.airspeed_scale.value:+.1f} % ({100 * found.airspeed_scale.lo:+.1f} to"
        f" {100 * found.airspeed_scale.hi:+.1f}), by GPS; corrected."
    )


TIME_TITLE = "time since the start of the log, s"


def electrical_power(results: Results, estimate: ElectricalEstimate) -> Figure:
    """Electrical power against airspeed with its 95 % interval, and the flight's moments reduced to level flight."""
    figure = Figure()
    V, _, lo, hi = curve_arrays(results.electrical_power)
    add_band(figure, V, (lo, hi), BLUE, 0.3)
    figure.add_scatter(
        x=rounded(estimate.measured_V_mps),
        y=rounded(estimate.measured_W),
        mode="markers",
        marker={"color": GRAY, "size": 7, "opacity": 0.6},
        name="the flight, reduced to level flight",
        hovertemplate="%{y:.0f} W",
    )
    add_curve(figure, results.electrical_power, "electrical power", BLUE, width=5)
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="power, W", range=[0, 1.2 * float(np.max(hi))])
    return styled(figure, 420, hover="closest")


def flight_figure(table: FlightTable, V_mps: NDArray[np.float64]) -> Figure:
    """Airspeed, height and electrical power of the whole log; the part used is shaded."""
    rows = (
        (V_mps, "airspeed, m/s"),
        (table.table["height_m"].to_numpy(), "height, m"),
        (table.table["power_W"].to_numpy(), "power, W"),
    )
    figure = Figure(len(rows))
    t_s = table.table.index.to_numpy()
    for i, (values, title) in enumerate(rows, start=1):
        x, y = thinned(t_s, values)
        figure.add_scatter(
            x=rounded(x), y=rounded(y), panel=i, mode="lines", line={"color": INK, "width": 1.8}, showlegend=False,
            name=title,
        )  # fmt: skip
        figure.update_yaxis(title=title, panel=i)
    figure.update_layout(
        shapes=[
            {
                "type": "rect", "xref": "x", "yref": "paper", "x0": t_s[part.start], "x1": t_s[part.stop - 1],
                "y0": 0, "y1": 1, "fillcolor": BLUE, "opacity": 0.12, "line": {"width": 0}, "layer": "below",
            }
            for part in table.airborne
        ]
    )  # fmt: skip
    figure.update_xaxis(title=TIME_TITLE)
    return styled(figure, 620)


def residuals(estimate: ElectricalEstimate) -> Figure:
    """The energy balance's residuals over time."""
    figure = Figure()
    figure.add_scatter(
        x=rounded(estimate.time_s), y=rounded(estimate.residual_W), mode="lines+markers",
        line={"color": BLUE, "width": 2}, name="residual", hovertemplate="%{y:.0f} W",
    )  # fmt: skip
    figure.update_xaxis(title=TIME_TITLE)
    figure.update_yaxis(title="residual, W")
    return styled(figure, 320)
