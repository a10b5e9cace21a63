"""Writes an analyzed flight as tables: CSV, Parquet or MATLAB files. Column names contain their units."""

import re
from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np
import pandas as pd

from flightpower.analysis.pages.exports import KINDS
from flightpower.analysis.pages.exports.derived import ERROR, derived, write_derived_log
from flightpower.analysis.pages.write import COLUMNS as STATE_COLUMNS
from flightpower.analysis.pipeline.runs import Analysis
from flightpower.analysis.pipeline.whole_flight import WholeFlightAnalysis
from flightpower.analysis.records.flight import Kind, PowerPoint
from flightpower.analysis.sources.recording import FlightRecording
from flightpower.analysis.trajectory.equations import GUST_FILTER_STATES
from flightpower.flight.errors import InputError
from flightpower.flight.files import write_file, write_files
from flightpower.flight.log_reader import Log

# Columns of the air data table whose names lack a unit, or that are used only inside the program.
RENAMED = {"rho": "density_kgpm3", "J": "advance_ratio", "throttle": "throttle_fraction"}
LEFT_OUT = (
    "speed_scale", "dalpha_dlndp_alpha_rad", "dlnV_dlndp_alpha", "alpha_by_upwash_rad", "alpha_by_rotation_rad",
    "beta_by_rotation_rad",
)  # fmt: skip
WITHOUT_UNIT = ("advance_ratio", "C_L", "C_D", "flying", "propeller_covered", "curve", "kind", "notes", "extrapolated")


def tables_of(analysis: Analysis | WholeFlightAnalysis) -> dict[str, pd.DataFrame]:
    """Return tables by name: `synchronized`, `states`, `derived`, `runs`, `curves`; see also `_of_whole_flight`.

    synchronized : every channel on one time base, corrected, with air data; index t_s since the log began
    states : reconstructed attitude, velocity, height, wind and gusts with standard errors; index t_s
    derived : of `derived.derived`; index t_s
    runs : one row per run: kind, start and end, speeds, change of altitude, notes
    curves : every curve of power against speed with its 95 % interval, named in `curve`
    """
    if isinstance(analysis, WholeFlightAnalysis):
        return _of_whole_flight(analysis)
    states, errors = (
        table.drop(columns=[*GUST_FILTER_STATES]).rename(columns=STATE_COLUMNS)
        for table in (analysis.trajectory.states, analysis.trajectory.states_error())
    )
    errors = errors.add_suffix(ERROR)
    in_turn = [name for state in states.columns for name in (state, f"{state}{ERROR}")]
    return {
        "synchronized": analysis.table.drop(columns=list(LEFT_OUT)).rename(columns=RENAMED),
        "states": pd.concat([states, errors], axis=1)[in_turn],
        "derived": derived(analysis.trajectory, analysis.aircraft, analysis.propeller),
        "runs": pd.DataFrame(
            [msgspec.structs.asdict(run) | {"notes": "; ".join(run.notes)} for run in analysis.results.runs]
        ),
        "curves": _curves(analysis),
    }


def _of_whole_flight(analysis: WholeFlightAnalysis) -> dict[str, pd.DataFrame]:
    """Return the tables by name:

    synchronized : the channels of the flight on one time base, the zero of the pitot corrected; index t_s
    windows : the energy balance of each window of some 8 s: the power that level flight at its airspeed would have
        taken, and what the fit leaves unexplained; index t_s
    curves : as for a flight with runs
    """
    estimate, results = analysis.estimate, analysis.results
    windows = pd.DataFrame(
        {"speed_mps": estimate.measured_V_mps, "level_power_W": estimate.measured_W, "residual_W": estimate.residual_W},
        index=pd.Index(estimate.time_s, name=INDEX),
    )
    table = analysis.flight.table.rename(columns=WITH_UNITS).assign(in_flight=analysis.flight.flown)
    curves = {
        "electrical power": results.electrical_power,
        "power required, as flown": results.power_required,
        "shaft power": results.points(Kind.SHAFT),
    }
    return {"synchronized": table, "windows": windows, "curves": _curve_table(curves)}


def _curves(analysis: Analysis) -> pd.DataFrame:
    results = analysis.results
    curves: dict[str, list[PowerPoint]] = {
        "power required, as flown": results.power_required,
        "power required, standard weight and sea level": results.power_required_standard,
        "cross-check by output error": results.cross_check,
    }
    for method in results.methods:
        curves[method.title] = method.power_required
    return _curve_table(curves)


def _curve_table(curves: Mapping[str, list[PowerPoint]]) -> pd.DataFrame:
    rows = [{"curve": name} | msgspec.structs.asdict(point) for name, points in curves.items() for point in points]
    return pd.DataFrame(rows)


INDEX = "t_s"
# Columns of a whole flight whose names lack the unit; ratios have no unit.
WITH_UNITS = {"rho": "rho_kgpm3"}


def write_csv(tables: Mapping[str, pd.DataFrame], folder: Path) -> None:
    """Write one CSV file per table, `folder`/NAME.csv. Raises InputError when the folder cannot be written."""
    texts = {
        folder / f"{name}.csv": _flat(table).to_csv(index=False, float_format="%.9g", lineterminator="\n")
        for name, table in tables.items()
    }
    write_files(texts)


def write_parquet(tables: Mapping[str, pd.DataFrame], folder: Path) -> None:
    """Write one Parquet file per table, `folder`/NAME.parquet. Raises InputError when it cannot be written."""
    try:
        import pyarrow  # noqa: F401
    except ModuleNotFoundError:
        raise InputError('Parquet needs pyarrow; run: pip install pyarrow, or export with "--to csv"') from None
    streams = {folder / f"{name}.parquet": BytesIO() for name in tables}
    for table, stream in zip(tables.values(), streams.values(), strict=True):
        _flat(table).to_parquet(stream, index=False)
    write_files({path: stream.getvalue() for path, stream in streams.items()})


def write_mat(tables: Mapping[str, pd.DataFrame], path: Path) -> None:
    """Write a MATLAB file (version 5) with one struct per table, whose fields are column vectors.

    Texts become cell arrays, and Boolean values 0 and 1. Raises InputError when the file cannot be written.
    """
    from scipy.io import savemat

    structs = {
        name: {matlab_name(column): _column(values) for column, values in _flat(table).items()}
        for name, table in tables.items()
    }
    stream = BytesIO()
    savemat(cast(Any, stream), structs, long_field_names=True, oned_as="column", do_compression=True)
    write_file(path, stream.getvalue())


def matlab_name(column: Any) -> str:
    """Return the name of a column as MATLAB permits it: at most 63 letters, digits and underscores."""
    return re.sub(r"\W", "_", str(column))[:63]


def _column(values: pd.Series) -> np.ndarray:
    if values.dtype == bool:
        return values.to_numpy(dtype=np.uint8)
    return values.to_numpy(dtype=float) if pd.api.types.is_numeric_dtype(values) else values.to_numpy(dtype=object)


def _flat(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table with its time, if it has one, as the first column."""
    return table.reset_index() if table.index.name == INDEX else table


WRITERS: dict[str, Callable[[Mapping[str, pd.DataFrame], Path], None]] = {
    "csv": write_csv,
    "parquet": write_parquet,
    "mat": write_mat,
}


def export_tables(tables: Mapping[str, pd.DataFrame], log: Log | FlightRecording, to: str, path: Path) -> None:
    """Write tables of a flight.

    to: one of KINDS     path: a folder for csv and parquet, a file for mat and mcap
    Raises InputError for another kind, or when it cannot be written.
    """
    if to not in KINDS:
        raise InputError(f"{to!r} is not a kind of export; choose one of {', '.join(KINDS)}")
    if to == "mcap":
        if not isinstance(log, Log):
            raise InputError(f"{log.path}: mcap: only for logs of the daemon; export with --to parquet, csv or mat")
        write_derived_log(tables, log, path)
    else:
        WRITERS[to](tables, path)
