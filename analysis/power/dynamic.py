"""The dynamic method: drag polar by maximum likelihood from accelerations and decelerations (3.24-3.45).

All runs of a flight are fitted at once: they share the aerodynamics and the systematic errors of the sensors, and each
has its own initial state. Pitch and height are states (method section 6): no attitude filter is trusted.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.air import bank_rad
from analysis.estimation import models, output_error, uncertainty
from analysis.estimation.data import Segment
from analysis.power.curve import Polar
from analysis.runs import Run
from analysis.stillness import Zeros
from flight.aircraft import Aircraft

Array = NDArray[np.float64]
POLAR = ("A0", "A1", "A2")
FLOOR_RAD = np.radians(0.05)
INPUTS = {
    "thrust": "thrust_N",
    "J": "J",
    "elevator": "elevator_rad",
    "q": "q_radps",
    "p": "p_radps",
    "r": "r_radps",
    "beta": "beta_rad",
    "rho": "rho",
}
OUTPUTS = {"V": "V_mps", "alpha": "alpha_rad", "ax": "ax_mps2", "az": "az_mps2", "h": "height_m"}
DRAWN = {
    "V": ("V, m/s", 1.0),
    "alpha": ("α, deg", 180 / np.pi),
    "ax": ("a<sub>x</sub>, m/s²", 1.0),
    "az": ("a<sub>z</sub>, m/s²", 1.0),
    "h": ("height, m", 1.0),
}


@dataclass(frozen=True)
class DynamicEstimate:
    """A drag polar with its covariance, and what a report shows of the fit."""

    polar: Polar
    parameters: list[tuple[str, float, float, str]]  # name, value, standard error, unit
    verdict: str
    warnings: list[str]
    fits: list[tuple[str, Array, dict[str, Array], dict[str, Array]]]  # run, time, measured, modelled


def estimate_polar(table: pd.DataFrame, runs: list[Run], aircraft: Aircraft, at_rest: Zeros | None) -> DynamicEstimate:
    """Fit all runs at once.

    table: as `air_data` leaves it. at_rest: the zeros that were taken out; without them the gyro's bias is unknown.
    """
    warnings = []
    priors = models.Priors()
    if at_rest is None:
        priors = models.Priors(
            gyro_bias_radps=0.02
        )  # an MPU9250 as it comes: data sheet, +-5 deg/s at 25 degC, typical 1
    if table["elevator_rad"].isna().all():
        warnings.append("No elevator angle in this log: its lift is taken as part of the lift slope.")
    segments = [_segment(table, run) for run in runs]
    model = models.pitch_and_height(aircraft, priors=priors)
    fit = output_error.estimate(model, segments, start=models.quick_start(aircraft, segments))
    if not fit.verdict.ok:
        warnings.append(f"The estimation did not end well: {fit.verdict}.")
    covariance = _covariance(fit)
    where = [fit.names.index(name) for name in POLAR]
    polar = Polar(fit.values[where], covariance[np.ix_(where, where)])
    error = dict(zip(fit.names, np.sqrt(np.diag(covariance)), strict=True))
    return DynamicEstimate(
        polar=polar,
        parameters=[(e.name, e.value, float(error[e.name]), e.unit) for e in fit.parameters.values() if e.free],
        verdict=str(fit.verdict),
        warnings=warnings,
        fits=[_drawn(segment, fit) for segment in segments],
    )


def _covariance(fit: output_error.Fit) -> Array:
    """Covariance of all estimates: the larger of what white and what coloured residuals give, and a floor.

    Coloured residuals make estimates several times less certain than white ones of the same size (method section 4),
    but a short record can also hide its colour: so the larger one counts. The floor stands for what no fit to these
    runs can see, a direction known to FLOOR_RAD: force across it, D = L tan(FLOOR_RAD), is a C_D proportional to C_L.
    """
    white, coloured = uncertainty.cramer_rao(fit).covariance, uncertainty.morelli_klein(fit).covariance
    scale = np.maximum(1.0, np.sqrt(np.diag(white) / np.diag(coloured)))
    covariance = coloured * np.outer(scale, scale)
    A1 = fit.names.index("A1")
    covariance[A1, A1] += np.tan(FLOOR_RAD) ** 2
    return covariance


def _segment(table: pd.DataFrame, run: Run) -> Segment:
    """One run as the estimator wants it: small gaps in inputs bridged, gaps in outputs left."""
    rows = slice(run.rows.start, run.rows.stop)
    data = table.iloc[rows]
    bank = bank_rad(table)[rows]
    inputs = {name: _filled(data[column]) for name, column in INPUTS.items()}
    return Segment(
        name=run.name,
        t_s=data.index.to_numpy(),
        u={**inputs, "phi": bank},
        z={name: data[column].to_numpy() for name, column in OUTPUTS.items()},
    )


def _filled(column: pd.Series) -> Array:
    """A column without gaps: linear across them; zero where nothing was ever measured."""
    return column.interpolate(limit_direction="both").fillna(0.0).to_numpy()


def _drawn(segment: Segment, fit: output_error.Fit):
    response = fit.responses[segment.name]
    outputs = dict(zip(fit.model.outputs, response.y.T, strict=True))
    measured = {title: segment.z[name] * scale for name, (title, scale) in DRAWN.items()}
    modelled = {title: outputs[name] * scale for name, (title, scale) in DRAWN.items()}
    return segment.name, segment.t_s, measured, modelled
