"""The report of electrical power: its page, figures and files."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.methods.whole_flight.curve import ElectricalEstimate
from analysis.methods.whole_flight.fit import samples_of
from analysis.methods.whole_flight.flight_table import FlightTable
from analysis.methods.whole_flight.settings import CURVE
from analysis.pages.answers import HeadlineAnswer, interval_text, optimum_remark
from analysis.pages.charts.figure import Axis, Cursor, Figure, Line, Points, Shade
from analysis.pages.charts.flight import over_time, time_axis
from analysis.pages.charts.style import BLUE, GRAY, band, curve_arrays, curve_lines, true_airspeed
from analysis.pages.html_page import HtmlTable, html_figure, render_page
from analysis.pages.sections.flight import electrical_facts, temperature_text
from analysis.pages.sections.performance import autopilot_section
from analysis.pages.wording import every, verdict
from analysis.records.flight import UNKNOWN_SPEED, CurveResult, Kind, Results, SpeedInterval
from analysis.results.files import to_csv, to_json
from analysis.results.previous import replaced
from flight.files import write_files
from flight.units import GRAVITY_MPS2

NOTHING_AGAINST = "Nothing speaks against this flight."


def write_electrical_report(results: Results, flight: FlightTable, estimate: ElectricalEstimate, folder: Path) -> str:
    """Write report.html, results.json and electrical_power.csv. Raises InputError when the folder cannot be written.

    Returns what of another log or of other options they replaced, in a sentence.
    """
    files: dict[str, str | bytes] = {"results.json": to_json(results), "electrical_power.csv": to_csv(results)}
    before = replaced(folder, results, files)
    files["report.html"] = _page(results, flight, estimate, before)
    write_files({folder / name: content for name, content in files.items()})
    return before


def electrical_answers(results: Results) -> list[HeadlineAnswer]:
    """Speeds of longest endurance and range, with both where the battery is known."""
    found = results.main
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
            ("Longest endurance", found.least_power_speed or UNKNOWN_SPEED, endurance),
            ("Longest range", found.best_range_speed or UNKNOWN_SPEED, distance),
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
    found = results.balance
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
            f"{temperature_text(results.air)}; from {found.flown_s / 60:.1f} min in the air"
        ),
        verdict=verdict(results.trust, results.evidence, NOTHING_AGAINST),
        hardly_flown=CURVE.percentiles[0],
        cards=electrical_answers(results),
        warnings=results.warnings,
        curve=curve_table(results),
        shared_part=_shared_part(results.main),
        withheld=results.withheld,
        autopilot=autopilot_section(results),
        drag=_drag_table(results),
        thrust_basis=found.thrust_basis,
        air=_air(results),
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
    required = results.power_required
    if not required:
        return None
    shaft = {p.speed_mps: p for p in results.points(Kind.SHAFT)}
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


def _shared_part(found: CurveResult) -> str:
    middle = found.interval_parts[len(found.interval_parts) // 2]
    whole = float(np.hypot(middle.noise_W, middle.systematic_W))
    return (
        f"At {middle.speed_mps:.0f} m/s the half width of the interval is {whole:.0f} W: {middle.noise_W:.0f} W by air"
        " motion and what the flight does not tell apart, which a longer flight reduces, and"
        f" {middle.systematic_W:.0f} W by what the whole flight shares: airspeed, current meter, mass, density."
    )


def _air(results: Results) -> str:
    air, scale = results.air, results.balance.airspeed_scale if results.balance else None
    if air.wind_mps is None or air.wind_from_deg is None:
        return "Without GPS neither wind nor the error of the airspeed is known."
    wind = f"Wind {air.wind_mps:.1f} m/s from {air.wind_from_deg:.0f} deg"
    if scale is None:
        return f"{wind}; airspeed is the velocity by GPS less the wind."
    return (
        f"{wind}. The airspeed in the log differs from the true one by {100 * scale.value:+.1f} %"
        f" ({100 * scale.lo:+.1f} to {100 * scale.hi:+.1f}), by GPS; corrected."
    )


TIME_TITLE = "time since the start of the log, s"


def electrical_power(results: Results, estimate: ElectricalEstimate) -> Figure:
    """Electrical power against airspeed with its 95 % interval, and the flight's moments reduced to level flight."""
    figure = Figure(height_px=420, cursor=Cursor.NEAREST, x=true_airspeed())
    V, _, lo, hi = curve_arrays(results.electrical_power)
    figure.add(
        band(V, (lo, hi), BLUE, 0.3, name="electrical power"),
        Points(
            x=estimate.measured_V_mps, y=estimate.measured_W, color=GRAY, size=7, opacity=0.6,
            name="the flight, reduced to level flight", value="{y:.0f} W",
        ),
        *curve_lines(results.electrical_power, "electrical power", BLUE, width=5),
    )  # fmt: skip
    figure.y = Axis("power", "W", limits=(0, 1.2 * float(np.max(hi))))
    return figure


def flight_figure(table: FlightTable, V_mps: NDArray[np.float64]) -> Figure:
    """Airspeed, height and electrical power of the whole log; the part used is shaded."""
    t_s = table.table.index.to_numpy()
    figure = over_time(
        [
            (t_s, V_mps, Axis("airspeed", "m/s")),
            (t_s, table.table["height_m"].to_numpy(), Axis("height", "m")),
            (t_s, table.table["power_W"].to_numpy(), Axis("power", "W")),
        ]
    )
    figure.shades = [Shade(float(t_s[part.start]), float(t_s[part.stop - 1]), BLUE, 0.12) for part in table.airborne]
    return figure


def residuals(estimate: ElectricalEstimate) -> Figure:
    """The energy balance's residuals over time."""
    figure = Figure(height_px=320, x=time_axis())
    figure.add(
        Line(
            x=estimate.time_s, y=estimate.residual_W, color=BLUE, symbol=None, label="residual", value="{y:.0f} W",
        )
    )  # fmt: skip
    figure.zero_lines.add(1)
    figure.y = Axis("residual", "W")
    return figure
