"""Compares the curve from `analyze` with steady flight in the same log, for real flights and with unaltered files.

python benchmarks/real_flights.py [FOLDER]: a Markdown table of errors, half widths, coverage, time and memory.
FOLDER holds the files of real-flights.md; default: ../shared/data/real-flights. Tables are read with the map that
`flightpower new columns` drafts. Curve and reference share mass, and thrust or current, so the comparison tests how
drag is found from motion.
"""

import gzip
import resource
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from records import Record, markdown, rounded

from flightpower.analysis.air.contents import Replacements
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate, estimate
from flightpower.analysis.methods.whole_flight.flight_table import FlightTable, flight_table
from flightpower.analysis.pipeline.runs import analyze_runs
from flightpower.analysis.records.flight import Results
from flightpower.analysis.sources.column_map import load_map, mapped_channels
from flightpower.analysis.sources.daemon_recording import recording_of
from flightpower.analysis.sources.map_draft import draft
from flightpower.analysis.sources.paparazzi import read_paparazzi
from flightpower.analysis.sources.position import velocity_by_position
from flightpower.analysis.sources.quantities import Quantity
from flightpower.analysis.sources.recording import FlightRecording
from flightpower.analysis.sources.table import as_log, log_of_table
from flightpower.analysis.sources.table_file import read_columns
from flightpower.flight.aircraft import parse_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log
from flightpower.flight.units import GRAVITY_MPS2 as g

Array = NDArray[np.float64]
BESIDE = [folder / "shared" / "data" / "real-flights" for folder in Path(__file__).resolve().parents]
FOLDER = next((folder for folder in BESIDE if folder.exists()), BESIDE[1])
CITATION = "citation-reference-flight.csv.gz"
WHOLE_FLIGHT, DECELERATIONS, WITH_VELOCITY, UNSURE_THRUST = (
    "Citation II, whole flight", "its decelerations alone", "with velocity by its positions",
    "with velocity, thrust known to 5 percent",
)  # fmt: skip
WEIGHT_N, WING_AREA_M2 = 62501.0, 30.0  # the weight is the mean of the steady points
SPEEDS_MPS = np.arange(65.0, 136.0, 10.0)

AIRCRAFT = f"""name = "citation"
[geometry]
span = "15.911 m"
chord = "2.0569 m"
wing_area = "{WING_AREA_M2} m^2"
[mass]
weight = "{WEIGHT_N} N"
[probe]
position = ["0 m", "0 m", "0 m"]
upwash_per_CL = "0 deg"
[uncertainty]
air_data_lag = "0.1 s"
thrust_scale = "1 %"
thrust_slope = 0.0001
"""
# The thrust program from the course has a slope that is wrong by 6 to 11 percent.
AIRCRAFT_OF_UNSURE_THRUST = AIRCRAFT.replace('"1 %"', '"5 %"').replace("0.0001", "0.05")


class Electrical(NamedTuple):
    """A flight that gives electrical power. Mass, wing area and span of the Cyclone and the Daredevil are guesses."""

    title: str
    file: str
    mass_kg: float
    wing_area_m2: float
    span_m: float
    without: bytes = b""  # lines of a text log that contain this are left out
    motors: int = 1  # only one of which is measured


ELECTRICAL = (
    Electrical("Daredevil, 10 July", "daredevil-2020-07-10-flight2.data.gz", 0.75, 0.23, 1.0),
    Electrical("the same without AIRSPEED", "daredevil-2020-07-10-flight2.data.gz", 0.75, 0.23, 1.0, b" AIRSPEED "),
    Electrical("the same without AIR_DATA", "daredevil-2020-07-10-flight2.data.gz", 0.75, 0.23, 1.0, b" AIR_DATA "),
    Electrical("Daredevil, 5 July", "daredevil-2020-07-05.data.gz", 0.75, 0.23, 1.0),
    Electrical("Cyclone", "cyclone-test.mat", 1.0, 0.18, 0.9, motors=2),
)
# Mean battery power [W] in level windows of 8 s of the flight of 10 July, by measured airspeed [m/s].
LEVEL_WINDOWS = {12.4: 17.9, 12.7: 19.7, 13.1: 20.4, 13.4: 21.5}


def draft_map(csv: Path, scratch: Path) -> None:
    (scratch / "columns.toml").write_text(draft(csv))


def citation_log(csv: Path, scratch: Path, *, with_velocity: bool = False) -> Log:
    """Make a log of the Citation's whole flight by the drafted map. with_velocity: add velocity from positions"""
    if not with_velocity:
        return log_of_table(csv, scratch / "columns.toml")
    channels = mapped_channels(csv, read_columns(csv), load_map(scratch / "columns.toml"))
    north, east = velocity_by_position(channels[Quantity.LATITUDE], channels[Quantity.LONGITUDE])
    return as_log(csv, channels | {Quantity.VELOCITY_NORTH: north, Quantity.VELOCITY_EAST: east})


def electrical_recording(flight: Electrical, folder: Path, scratch: Path) -> FlightRecording:
    path = folder / flight.file
    if flight.file.endswith(".mat"):
        text = draft(path).replace('unit = "A"', f'unit = "A"\nfactor = {flight.motors}')
        (scratch / "map.toml").write_text(text)
        return recording_of(log_of_table(path, scratch / "map.toml"))
    excerpt = scratch / "flight.data"
    with gzip.open(path) as stream:
        excerpt.write_bytes(b"".join(line for line in stream if not flight.without or flight.without not in line))
    return replace(read_paparazzi(excerpt), path=path)


def level_windows(table: FlightTable, estimate: ElectricalEstimate) -> Iterator[tuple[float, float]]:
    """Yield true airspeed [m/s] and mean battery power [W] in steady 8 s windows, for lack of published data."""
    rows = table.table
    V = np.sqrt(2 * np.maximum(rows["pressure_Pa"], 0.0) / rows["rho"]).to_numpy() / (1 + estimate.airspeed.scale)
    energy = estimate.conditions.mass_kg * (g * rows["height_m"].to_numpy() + V**2 / 2)
    power = rows["power_W"].to_numpy()
    for airborne in table.airborne:
        for i in range(airborne.start, airborne.stop - 40, 10):
            window = slice(i, i + 40)
            if abs(energy[i + 40] - energy[i]) / 8 < 0.05 * np.median(power[airborne]):
                yield float(V[window].mean()), float(power[window].mean())


def electrical_row(flight: Electrical, folder: Path, scratch: Path) -> Record:
    started = time.process_time()
    try:
        table = flight_table(electrical_recording(flight, folder, scratch), flight.mass_kg * g, flight.wing_area_m2)
        electrical = estimate(table, flight.mass_kg * g, flight.wing_area_m2, flight.span_m, flight.file)
    except InputError as refused:
        return {"flight": flight.title, "curve by": f"refused: {refused}"}
    seconds = time.process_time() - started
    if flight.file == ELECTRICAL[0].file:
        V = np.array([*LEVEL_WINDOWS]) / (1 + electrical.airspeed.scale)
        reference = np.array([*LEVEL_WINDOWS.values()])
    else:
        airspeed_mps, watts = np.array([*level_windows(table, electrical)]).T
        edges = np.quantile(airspeed_mps, np.linspace(0, 1, 5))
        windows = [(airspeed_mps >= low) & (airspeed_mps <= high) for low, high in pairwise(edges)]
        V = np.array([airspeed_mps[window].mean() for window in windows])
        reference = np.array([watts[window].mean() for window in windows])
    reached = (V >= electrical.V_mps[0]) & (V <= electrical.V_mps[-1])
    V, reference = V[reached], reference[reached]
    power, sigma = (
        np.interp(V, electrical.V_mps, values) for values in (electrical.power_W, electrical.standard_error_W)
    )
    error, half = 100 * (power / reference - 1), 100 * NORMAL_95 * sigma / power
    inside = np.count_nonzero(np.abs(power - reference) < NORMAL_95 * sigma)
    return {
        "flight": flight.title, "curve by": "energy, electrical", "maneuvers": f"{len(electrical.time_s)} windows",
        "m/s": f"{V[0]:.1f} to {V[-1]:.1f}", "error, %": f"{error.min():+.1f} to {error.max():+.1f}",
        "half width, %": f"{half.min():.0f} to {half.max():.0f}", "inside": f"{inside} of {len(V)}", "trust": "",
        "s": rounded(seconds), "MB": rounded(_megabytes()),
    }  # fmt: skip


def _megabytes() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def steady_power_W(csv: Path, rho: float) -> Array:
    """Return power required at SPEEDS_MPS: a two-term polar fitted to drag, from energy rate, in steady level rows."""
    d = pd.read_csv(csv)
    names = ["true_airspeed_mps", "altitude_m", "upward_specific_force_less_1g_mps2"]
    smooth = d[names].rolling(21, center=True, min_periods=1).mean()
    V, mass, thrust = smooth["true_airspeed_mps"], d.mass_kg, d.thrust_N
    air = 101325 * (1 - 0.0065 * smooth["altitude_m"] / 288.15) ** 5.25588 / 287.053 / d.static_temperature_K
    Vdot, climb = (np.gradient(smooth[name], d.time_s) for name in ("true_airspeed_mps", "altitude_m"))
    load = smooth["upward_specific_force_less_1g_mps2"]
    steady = (V > 55) & (np.abs(Vdot) < 0.05) & (np.abs(climb) < 2) & (d.roll_deg.abs() < 7) & (load.abs() < 0.6)
    evenly_N = thrust.rolling(21, center=True, min_periods=1).mean().fillna(0.0)
    steady &= thrust.notna() & (np.abs(np.gradient(evenly_N, d.time_s)) < 60)
    qS = (air * V**2 / 2 * WING_AREA_M2)[steady]
    CL = (mass * (load + g))[steady] / qS
    CD = (thrust - mass * (Vdot + g * climb / V))[steady] / qS
    (CD0, K), *_ = np.linalg.lstsq(np.stack([np.ones(len(CL)), CL**2], axis=1), CD, rcond=None)
    qS_level = rho * SPEEDS_MPS**2 / 2 * WING_AREA_M2
    return np.asarray(qS_level * SPEEDS_MPS * (CD0 + K * (WEIGHT_N / qS_level) ** 2))


def row(title: str, results: Results, reference_W: Array, cost: Record) -> Record:
    """Return one line of the table, for the speeds that the curve covers."""
    curve = results.power_required
    V = [point.speed_mps for point in curve]
    flown = (SPEEDS_MPS >= V[0]) & (SPEEDS_MPS <= V[-1])
    power, low, high = (
        np.interp(SPEEDS_MPS, V, [getattr(point, name) for point in curve])[flown]
        for name in ("power_W", "power_lo_W", "power_hi_W")
    )
    reference = reference_W[flown]
    error, half = 100 * (power / reference - 1), 100 * (high - low) / 2 / power
    inside = np.count_nonzero((low < reference) & (reference < high))
    method = results.methods_tried[-1].title
    speeds = f"{SPEEDS_MPS[flown][0]:.0f} to {SPEEDS_MPS[flown][-1]:.0f}"
    return {
        "flight": title, "curve by": method, "maneuvers": len(results.runs), "m/s": speeds,
        "error, %": f"{error.min():+.1f} to {error.max():+.1f}",
        "half width, %": f"{half.min():.1f} to {half.max():.1f}", "inside": f"{inside} of {len(reference)}",
        "trust": str(results.trust), **cost,
    }  # fmt: skip


def citation_row(title: str, folder: Path, scratch: Path) -> Record:
    """Return a row for the flight: whole (which writes a file of decelerations), by these alone, or by position."""
    csv, runs_file = folder / CITATION, scratch / "runs.toml"
    log = citation_log(csv, scratch, with_velocity=title in {WITH_VELOCITY, UNSURE_THRUST})
    started = time.process_time()
    aircraft = AIRCRAFT_OF_UNSURE_THRUST if title == UNSURE_THRUST else AIRCRAFT
    replacements = Replacements(aircraft=parse_aircraft(aircraft, "citation.toml"))
    analysis = analyze_runs(log, replacements, runs_file=runs_file if title == DECELERATIONS else None)
    seconds, megabytes = time.process_time() - started, _megabytes()
    decelerations = analysis.maneuvers.of("deceleration")
    runs_file.write_text(
        "".join(
            f'[[run]]\nkind = "{run.kind}"\nstart = "{run.start_s:.2f} s"\nend = "{run.end_s:.2f} s"\n'
            for run in decelerations
        )
    )
    reference_W = steady_power_W(csv, analysis.condition.rho)
    return row(title, analysis.results, reference_W, {"s": rounded(seconds), "MB": rounded(megabytes)})


TITLES = (*(electrical.title for electrical in ELECTRICAL), WHOLE_FLIGHT, DECELERATIONS, WITH_VELOCITY, UNSURE_THRUST)


def records(titles: Sequence[str] = TITLES, folder: Path = FOLDER) -> list[Record]:
    """Return a row per flight, each from its own process for its own peak memory; no row without the flight's files."""
    if not folder.exists():
        return []
    single_process = ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1)
    records, citation = [], [title for title in titles if title in TITLES[len(ELECTRICAL) :]]
    with tempfile.TemporaryDirectory() as name, single_process as process:
        scratch = Path(name)
        for flight in ELECTRICAL:
            if flight.title in titles:
                records.append(process.submit(electrical_row, flight, folder, scratch).result())
        if citation:
            process.submit(draft_map, folder / CITATION, scratch).result()
        records += [process.submit(citation_row, title, folder, scratch).result() for title in citation]
    return records


if __name__ == "__main__":
    print(markdown(records(TITLES, Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)))
