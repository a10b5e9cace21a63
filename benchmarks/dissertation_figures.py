"""Draws the figures of benchmarks/dissertation.py; each function's docstring gives the source's figure number."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from dissertation_flights import (
    AIRCRAFT,
    CASES,
    COEFFICIENTS,
    NOISE_FACTORS,
    Curve,
    FlightFigures,
    FlightName,
    RunFit,
    true_estimates,
)
from plotly.subplots import make_subplots

BLUE, RED, GREEN, PURPLE, GRAY, BLACK = "#1f5fa8", "#c0392b", "#2e8b57", "#8e44ad", "#7f8c8d", "#000000"
OUTPUTS = {"V": ("V, m/s", 1.0), "alpha": ("α, deg", 180 / np.pi), "ax": ("ax, m/s²", 1.0), "az": ("az, m/s²", 1.0)}
SPEED, POWER, TIME = "true airspeed, m/s", "power required, W", "time since the run began, s"
Flights = dict[FlightName, FlightFigures]


def _panels(
    titles: Sequence[str], columns: int, height: int, x: str = "", y: Sequence[str] = (), **options: Any
) -> Any:
    rows = -(-len(titles) // columns)
    figure = make_subplots(rows=rows, cols=columns, subplot_titles=titles, **options)
    figure.update_layout(template="plotly_white", width=1000, height=height, font={"size": 13})
    figure.update_layout(margin={"l": 60, "r": 15, "t": 40, "b": 60}, legend={"orientation": "h", "y": -60 / height})
    figure.update_annotations(font_size=14)
    for column in range(1, columns + 1):
        figure.update_xaxes(title_text=x, row=rows, col=column)
    for i, text in enumerate(y):
        figure.update_yaxes(title_text=text, row=i + 1, col=1)
    return figure


def _line(figure: Any, x: Any, y: Any, name: str, color: str, where: tuple[int, int], **style: Any) -> None:
    in_legend = style.pop("legend", True) and name not in {trace.name for trace in figure.data if trace.showlegend}
    dash = style.pop("dash", "solid")
    width = style.pop("width", 2)
    figure.add_scatter(
        x=x, y=y, name=name, line={"color": color, "width": width, "dash": dash}, showlegend=in_legend,
        row=where[0], col=where[1], **style,
    )  # fmt: skip


def _band(figure: Any, curve: Curve, color: str, where: tuple[int, int]) -> None:
    red, green, blue = (int(color[i : i + 2], 16) for i in (1, 3, 5))
    figure.add_scatter(
        x=np.concatenate([curve.V, curve.V[::-1]]),
        y=np.concatenate([curve.power - curve.half, (curve.power + curve.half)[::-1]]),
        fill="toself", fillcolor=f"rgba({red},{green},{blue},0.12)", line={"width": 0}, showlegend=False,
        hoverinfo="skip", mode="lines", row=where[0], col=where[1],
    )  # fmt: skip


def _truth(figure: Any, flight: FlightFigures, where: tuple[int, int], until: float) -> None:
    inside = flight.truth.V <= until
    _line(figure, flight.truth.V[inside], flight.truth.power[inside], "simulator's truth", BLACK, where, dash="dash")


def _points(
    figure: Any, flight: FlightFigures, where: tuple[int, int], factors: tuple[float, float] = (1.0, 1.0)
) -> None:
    if len(flight.points):
        V, power, _, hi = flight.points.T
        figure.add_scatter(
            x=factors[1] * V, y=factors[0] * power, mode="markers", name="steady points",
            error_y={"array": factors[0] * (hi - power), "thickness": 1.5}, marker={"color": GREEN, "size": 8},
            showlegend=where == (1, 1), row=where[0], col=where[1],
        )  # fmt: skip


def piw_viw(flights: Flights) -> Any:
    """Draw Fig. 7.1."""
    figure = _panels(list(AIRCRAFT), 3, 400, "VIW, m/s", ["PIW, W"])
    for i, aircraft in enumerate(AIRCRAFT.values(), start=1):
        flight = flights[FlightName(aircraft, "steady-points")]
        by_power, by_speed = flight.to_standard
        for method, title, color, dash in (
            ("piw-viw", "PIW-VIW, three terms", BLUE, "solid"),
            ("piw-viw-two-term", "PIW-VIW, two terms (2.6)", RED, "dot"),
        ):
            curve = flight.curves[method]
            _line(figure, by_speed * curve.V, by_power * curve.power, title, color, (1, i), dash=dash)
        inside = flight.truth.V <= 1.03 * flight.points[:, 0].max()
        truth = flight.truth
        _line(figure, by_speed * truth.V[inside], by_power * truth.power[inside], "simulator's truth", BLACK, (1, i),
              dash="dash")  # fmt: skip
        _points(figure, flight, (1, i), flight.to_standard)
    return figure


def _first(flight: FlightFigures, kind: str) -> RunFit:
    """Return the longest run of a kind."""
    return max((fit for fit in flight.fits if fit.run.startswith(kind)), key=lambda fit: fit.t_s[-1])


def fits(flights: Flights) -> Any:
    """Draw Figs. 7.2 to 7.5: each run fitted alone by the two-state model."""
    flight = flights[FlightName("nexstar", "two-pairs")]
    runs = [_first(flight, kind) for kind in ("deceleration", "acceleration")]
    titles = [
        f"{kind}: {what}" for _ in OUTPUTS for kind in ("deceleration", "acceleration") for what in ("fit", "residuals")
    ]
    figure = _panels(titles, 4, 900, TIME, [title for title, _ in OUTPUTS.values()], vertical_spacing=0.06)
    for row, (name, (_, unit)) in enumerate(OUTPUTS.items(), start=1):
        for i, run in enumerate(runs):
            column = 2 * i + 1
            _line(figure, run.t_s, unit * run.measured[name], "measured", GRAY, (row, column), mode="markers",
                  marker={"size": 4, "color": GRAY})  # fmt: skip
            _line(figure, run.t_s, unit * run.modeled[name], "model", RED, (row, column))
            rest = unit * (run.measured[name] - run.modeled[name])
            _line(figure, run.t_s, rest, "residual", BLUE, (row, column + 1), width=1)
    return figure


def curves(flights: Flights) -> Any:
    """Draw Figs. 7.6, 7.11 and 7.16."""
    figure = _panels(list(AIRCRAFT), 3, 440, SPEED, [POWER])
    for i, aircraft in enumerate(AIRCRAFT.values(), start=1):
        flight, steady = (flights[FlightName(aircraft, plan)] for plan in ("two-pairs", "steady-points"))
        fastest = max(fit.curve.V[-1] for fit in flight.fits)
        _band(figure, flight.curves["two-state"], BLUE, (1, i))
        for fit in flight.fits:
            kind, color = ("acceleration", RED) if fit.run.startswith("acc") else ("deceleration", PURPLE)
            _line(figure, fit.curve.V, fit.curve.power, f"one {kind} by two states", color, (1, i), width=1.2)
        two_state, dynamic = flight.curves["two-state"], flight.curves["dynamic"]
        _line(figure, two_state.V, two_state.power, "all runs by two states, with its 95 %", BLUE, (1, i), width=3)
        _line(figure, dynamic.V, dynamic.power, "dynamic method", GREEN, (1, i), dash="dot", width=3)
        _truth(figure, flight, (1, i), fastest)
        _points(figure, steady, (1, i))
    return figure


def _high_passed(x: np.ndarray) -> np.ndarray:
    """Remove changes slower than some tenths of a second: subtract the mean of 11 samples."""
    return np.convolve(x, np.r_[np.zeros(5), 1.0, np.zeros(5)] - 1 / 11, mode="valid")


def power_on_noise(flights: Flights) -> Any:
    """Draw Fig. 7.7."""
    file_of_title = {"Astraeus HS": "astraeus-hs", "Nexstar": "nexstar"}
    figure = _panels(
        [f"{name}, {run}" for _ in range(2) for name in file_of_title for run in ("at rest", "acceleration")], 4, 500,
        "time, s", ["ax less its mean, m/s²", "q less its mean, rad/s"], shared_yaxes=True,
    )  # fmt: skip
    for i, aircraft in enumerate(file_of_title.values()):
        flight = flights[FlightName(aircraft, "two-pairs")]
        for j, kind in enumerate(("standing", "acceleration")):
            run = next(rows for name, rows in flight.runs.items() if name.startswith(kind))
            for row, column in enumerate(("ax_mps2", "q_radps"), start=1):
                x = run[column].to_numpy()[:300]
                _line(figure, np.arange(len(x)) / 25, _high_passed(x), "", BLUE, (row, 2 * i + j + 1), width=1,
                      legend=False)  # fmt: skip
    return figure


def signal_to_noise(flights: Flights, limits: dict[str, list[tuple[float, float]]]) -> Any:
    """Draw Fig. 7.8 with Fig. 4.12: SNR of pitch rate in each run, and where C_Lq becomes significant.

    limits : by maneuver (factor on the noise, SNR)
    """
    figure = _panels(["pitch rate of the runs", "C_Lq significant above"], 2, 440)
    for i, aircraft in enumerate(AIRCRAFT.values()):
        fits = [fit for name, flight in flights.items() if name.aircraft == aircraft for fit in flight.fits
                 if name.noise == 1]  # fmt: skip
        for kind, color, symbol in (("acceleration", RED, "circle"), ("deceleration", PURPLE, "square")):
            snr = [fit.snr for fit in fits if fit.run.startswith(kind)]
            figure.add_scatter(
                x=i + np.linspace(-0.2, 0.2, len(snr)), y=snr, mode="markers", name=kind, showlegend=i == 0,
                marker={"color": color, "symbol": symbol, "size": 8}, row=1, col=1,
            )  # fmt: skip
        significant = [(fit.snr, kind) for fit in fits if abs(fit.t_CLq) > 1.96]
        figure.add_scatter(
            x=[i + 0.3] * len(significant), y=[snr for snr, _ in significant], mode="markers", name="C_Lq significant",
            marker={"color": BLACK, "symbol": "x", "size": 9}, showlegend=i == 0, row=1, col=1,
        )  # fmt: skip
    for (name, points), color in zip(limits.items(), (BLUE, GREEN, GRAY), strict=False):
        determined = [(factor, snr) for factor, snr in points if snr > 0]  # leaves out never (NaN) and always (0)
        figure.add_scatter(
            x=[factor for factor, _ in determined], y=[snr for _, snr in determined], name=f"limit, {name}",
            mode="lines+markers", line={"color": color}, row=1, col=2,
        )  # fmt: skip
    figure.update_xaxes(tickvals=[0, 1, 2], ticktext=list(AIRCRAFT), row=1, col=1)
    figure.update_xaxes(title_text="factor on all other noise", tickvals=[0.5, 1, 1.5], row=1, col=2)
    figure.update_yaxes(type="log", title_text="SNR of pitch rate (4.7)", row=1, col=1)
    figure.update_yaxes(type="log", row=1, col=2)
    return figure


def estimates(flights: Flights) -> Any:
    """Draw Fig. 7.9: estimates of each run with 95 % intervals, for white (thick) and colored residuals (thin)."""
    figure = _panels(list(COEFFICIENTS), 3, 560, "", vertical_spacing=0.14)
    for i, aircraft in enumerate(AIRCRAFT.values()):
        flight, truth = flights[FlightName(aircraft, "two-pairs")], true_estimates(aircraft)
        for j, name in enumerate(COEFFICIENTS):
            where = {"row": j // 3 + 1, "col": j % 3 + 1}
            for kind, color in (("acceleration", RED), ("deceleration", PURPLE)):
                rows = [fit.estimates[name] for fit in flight.fits if fit.run.startswith(kind)]
                x = i + np.linspace(0.05, 0.3, len(rows)) * (1 if kind == "acceleration" else -1)
                for k, width in ((2, 1), (1, 4)):
                    figure.add_scatter(
                        x=x, y=[row[0] for row in rows], mode="markers", name=kind, marker={"color": color, "size": 6},
                        error_y={"array": [1.96 * row[k] for row in rows], "thickness": width, "width": 0},
                        showlegend=i == j == 0 and k == 1, **where,
                    )  # fmt: skip
            figure.add_scatter(
                x=[i - 0.4, i + 0.4], y=[truth[name]] * 2, mode="lines", name="simulator's truth",
                line={"color": BLACK, "dash": "dash"}, showlegend=i == j == 0, **where,
            )  # fmt: skip
            spread = [fit.estimates[name][0] for aircraft in AIRCRAFT.values() for fit in
                      flights[FlightName(aircraft, "two-pairs")].fits]  # fmt: skip
            low, high = min([*spread, truth[name]]), max([*spread, truth[name]])
            figure.update_yaxes(range=[low - 0.5 * (high - low), high + 0.5 * (high - low)], **where)
    figure.update_xaxes(tickvals=[0, 1, 2], ticktext=["LS", "HS", "Nexstar"])
    return figure


def with_and_without_CLq(flights: Flights) -> Any:
    """Draw Fig. 7.10."""
    flight = flights[FlightName("nexstar", "two-pairs")]
    figure = _panels([title for title, _ in OUTPUTS.values()], 2, 480, TIME, vertical_spacing=0.14)
    for kind, color in (("acceleration", RED), ("deceleration", PURPLE)):
        run = _first(flight, kind)
        for i, (name, (_, unit)) in enumerate(OUTPUTS.items()):
            change = unit * run.change_by_CLq[name]
            _line(figure, run.t_s, change, f"{kind}: with less without C_Lq", color, (i // 2 + 1, i % 2 + 1))
    return figure


def noise(flights: Flights) -> Any:
    """Draw Fig. 7.12: the same flight with more and less noise."""
    figure = _panels(["one acceleration, two states", "one deceleration, two states", "all runs, two states"], 3, 440,
                     SPEED, ["error of power required, W"])  # fmt: skip
    for factor, color in zip(NOISE_FACTORS, (BLUE, GREEN, RED, PURPLE), strict=True):
        flight = flights[FlightName("nexstar", "two-pairs", factor)]
        curves = [_first(flight, kind).curve for kind in ("acceleration", "deceleration")] + [
            flight.curves["two-state"]
        ]
        for i, curve in enumerate(curves, start=1):
            truth = np.interp(curve.V, flight.truth.V, flight.truth.power)
            _line(figure, curve.V, curve.power - truth, f"noise × {factor:g}", color, (1, i))
    return figure


def throttle(flights: Flights) -> Any:
    """Draw Figs. 7.13 to 7.15: pitch after a step and after a ramp of the throttle, and the curves of both runs."""
    flight = flights[FlightName("nexstar", "throttle-step")]
    accelerations = [(fit, flight.runs[fit.run]) for fit in flight.fits if fit.run.startswith("acceleration")]
    figure = _panels(["throttle", "pitch rate as measured, deg/s", "power required, W"], 3, 420, TIME)
    names = (("step", RED), ("ramp of 2 s", BLUE))
    for (fit, run), (name, color) in zip(accelerations, names, strict=False):
        t = run.index.to_numpy() - run.index[0]
        early = t < 4
        _line(figure, t[early], run["throttle"].to_numpy()[early], name, color, (1, 1))
        _line(figure, t[early], np.degrees(run["q_radps"].to_numpy()[early]), name, color, (1, 2))
        _line(figure, fit.curve.V, fit.curve.power, name, color, (1, 3))
        _band(figure, fit.curve, color, (1, 3))
    _truth(figure, flight, (1, 3), max(fit.curve.V[-1] for fit, _ in accelerations))
    figure.update_xaxes(title_text=SPEED, row=1, col=3)
    return figure


def cases(flights: Flights) -> Any:
    """Draw Figs. 4.4 and 4.7 to 4.11: cases 1 to 3 with both Astraeus aircraft."""
    titles = [
        f"{name}, {estimator}"
        for estimator in ("dynamic method", "two states")
        for name in ("Astraeus LS", "Astraeus HS")
    ]
    figure = _panels(titles, 2, 640, SPEED, ["error of power, W"] * 2, vertical_spacing=0.12)
    for column, aircraft in enumerate(("astraeus-ls", "astraeus-hs"), start=1):
        for plan, color in zip(CASES, (BLUE, GREEN, RED, PURPLE, GRAY), strict=True):
            flight = flights[FlightName(aircraft, plan)]
            for row, method in enumerate(("dynamic", "two-state"), start=1):
                curve = flight.curves.get(method)
                if curve is not None:
                    truth = np.interp(curve.V, flight.truth.V, flight.truth.power)
                    _line(figure, curve.V, curve.power - truth, plan, color, (row, column))
    return figure


FIGURES = {
    "7-1-piw-viw": piw_viw,
    "7-2-fits": fits,
    "7-6-curves": curves,
    "7-7-power-on-noise": power_on_noise,
    "7-9-estimates": estimates,
    "7-10-clq": with_and_without_CLq,
    "7-12-noise": noise,
    "7-13-throttle": throttle,
    "4-cases": cases,
}
