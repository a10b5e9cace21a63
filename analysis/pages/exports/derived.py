"""Quantities derived along the trajectory, with standard errors: airspeed, flow angle, attitude, thrust, C_L, C_D.

They are written as a table and, with the position, as a second MCAP file for Foxglove and PlotJuggler. Its times are
the log's, so that both files can be opened together.
"""

from collections.abc import Mapping
from importlib import resources
from io import BytesIO
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd
from mcap.writer import Writer

from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods.forces import FlightForces
from flightpower.analysis.methods.thrust_prior import J_REFERENCE, thrust_prior
from flightpower.analysis.sources.daemon import is_good, times_ns, values
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.files import write_files
from flightpower.flight.log_reader import Log
from flightpower.flight.propeller import Propeller
from flightpower.flight.runs import AIRCRAFT_SIZE

QUANTITIES = ("alpha_rad", "V_mps", "theta_rad", "thrust_N", "C_L", "C_D")
ERROR = "_standard_error"


def derived(trajectory: Trajectory, aircraft: Aircraft, propeller: Propeller) -> pd.DataFrame:
    """Return QUANTITIES and the standard error of each (`alpha_rad_standard_error`), one row per block, index t_s.

    Thrust is from the propeller table. Standard errors come from repetition along perturbed trajectories (sensor errors
    in each independent direction, and draws of the states' random errors) and with a different weight, and from the
    prior standard deviations of the propeller table. Values are NaN where the aircraft is at rest. Coefficients are
    also NaN near the ground, where it may be rolling, and thrust where the motor is stopped.
    """
    flight_forces = FlightForces(trajectory, aircraft, propeller)
    states, errors = trajectory.states.to_numpy(), trajectory.sensor_errors
    theta = trajectory.states.columns.get_loc("theta")

    def quantities(flight_forces: FlightForces, states: Array, errors: Array) -> tuple[Array, pd.DataFrame]:
        f = flight_forces.forces(states, errors)
        thrust_N = f["thrust_along_V_over_m_mps2"] * flight_forces.aircraft.mass_kg / np.cos(f["alpha"])
        return np.stack([f["alpha"], f["V"], states[:, theta], thrust_N, f["CL"], f["CD"]], axis=1), f

    nominal, f = quantities(flight_forces, states, errors)
    variance = np.zeros_like(nominal)
    for error in np.linalg.cholesky(trajectory.covariance).T:
        moved, _ = quantities(flight_forces, states + trajectory.state_sensitivity @ error, errors + error)
        variance += (moved - nominal) ** 2
    for draw in trajectory.draws:
        variance += (quantities(flight_forces, states + draw, errors)[0] - nominal) ** 2 / len(trajectory.draws)
    heavier, _ = quantities(covariance.forces_with_more_weight(flight_forces), states, errors)
    variance += (heavier - nominal) ** 2
    variance[:, QUANTITIES.index("thrust_N") :] += _by_thrust_table(nominal, f, aircraft)
    # Below this dynamic pressure, airspeed is only noise.
    qbar_Pa = f["rho"].to_numpy() * nominal[:, 1] ** 2 / 2
    defined = np.repeat(qbar_Pa[:, None] > AIRCRAFT_SIZE.least_flying_Pa, len(QUANTITIES), axis=1)
    defined[:, QUANTITIES.index("C_L") :] &= trajectory.block_means.flying[:, None]
    columns = dict(zip(QUANTITIES, np.where(defined, nominal, np.nan).T, strict=True))
    spread = np.where(defined, np.sqrt(variance), np.nan)
    columns |= {f"{name}{ERROR}": column for name, column in zip(QUANTITIES, spread.T, strict=True)}
    index = pd.Index(flight_forces.t_s, name="t_s")
    return pd.DataFrame({name: columns[name] for q in QUANTITIES for name in (q, f"{q}{ERROR}")}, index=index)


def _by_thrust_table(nominal: Array, f: pd.DataFrame, aircraft: Aircraft) -> Array:
    """Return variances (n, 3) of thrust, C_L and C_D due to the errors of the propeller table."""
    alpha, thrust_N = nominal[:, 0], nominal[:, QUANTITIES.index("thrust_N")]
    (scale, covariance), (_, slope) = thrust_prior(aircraft).second_moment
    from_reference = f["J"].to_numpy() - J_REFERENCE
    beyond_N = f["thrust_beyond_over_m_mps2"].to_numpy() * aircraft.mass_kg / np.cos(alpha)
    variance_N2 = thrust_N**2 * (scale + 2 * covariance * from_reference + slope * from_reference**2) + beyond_N**2
    qS_N = f["qS_over_m_mps2"].to_numpy() * aircraft.mass_kg
    return np.stack(
        [variance_N2, variance_N2 * (np.sin(alpha) / qS_N) ** 2, variance_N2 * (np.cos(alpha) / qS_N) ** 2], axis=1
    )


PROFILE = "flightpower-derived"
LOCATION = "/derived/location"
STATES, RUNS = "/derived/states", "/derived/run"
TOPICS = {name: f"/derived/{name.split('_')[0] if name[0] != 'C' else name}" for name in QUANTITIES}
FIX = ("latitude_deg", "longitude_deg", "height_m", "horizontal_accuracy_m", "vertical_accuracy_m")
LAYOUTS = ("foxglove-layout.json", "plotjuggler-layout.xml")

# github.com/foxglove/foxglove-sdk, schemas/jsonschema/LocationFix.json
LOCATION_FIX = {
    "title": "foxglove.LocationFix",
    "description": "A navigation satellite fix for any Global Navigation Satellite System",
    "type": "object",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {"sec": {"type": "integer", "minimum": 0}, "nsec": {"type": "integer", "minimum": 0}},
        },
        "frame_id": {"type": "string"},
        "latitude": {"type": "number", "description": "Latitude in degrees"},
        "longitude": {"type": "number", "description": "Longitude in degrees"},
        "altitude": {"type": "number", "description": "Altitude in meters"},
        "position_covariance": {
            "type": "array",
            "items": {"type": "number"},
            "minItems": 9,
            "maxItems": 9,
            "description": "Position covariance (m^2) in east, north, up, row-major",
        },
        "position_covariance_type": {"type": "integer", "description": "0 unknown, 2 diagonal known"},
    },
}


def write_derived_log(tables: Mapping[str, pd.DataFrame], log: Log, path: Path) -> None:
    """Write `path`, and next to it the layouts for Foxglove and PlotJuggler. Raises InputError when that fails."""
    stream = BytesIO()
    writer = Writer(stream)
    writer.start(profile=PROFILE, library="flightpower")
    start_ns = int(times_ns(log.entries["/imu"])[0])
    for name, topic in TOPICS.items():
        _write_table(writer, topic, tables["derived"][[name, f"{name}{ERROR}"]], start_ns)
    _write_table(writer, STATES, tables["states"], start_ns)
    _write_table(writer, RUNS, tables["runs"].set_index(tables["runs"]["start_s"]), start_ns)
    _write_location(writer, log)
    writer.finish()
    folder = resources.files("flightpower.analysis.pages.exports") / "layouts"
    layouts = {path.parent / layout: (folder / layout).read_bytes() for layout in LAYOUTS}
    write_files({path: stream.getvalue(), **layouts})


def _write_table(writer: Writer, topic: str, table: pd.DataFrame, start_ns: int) -> None:
    """Write one message per row that has any number, with the fields of the table; index: seconds since `start_ns`."""
    table = table.dropna(how="all")
    kinds = {name: "number" if pd.api.types.is_numeric_dtype(table[name]) else "string" for name in table}
    schema = {"type": "object", "properties": {str(name): {"type": kind} for name, kind in kinds.items()}}
    channel = _channel(writer, topic, topic.strip("/").replace("/", "."), schema)
    taken_ns = start_ns + np.rint(table.index.to_numpy() * 1e9).astype(np.int64)
    for time_ns, row in zip(taken_ns.tolist(), table.to_dict("records"), strict=True):
        _add(writer, channel, time_ns, row)


def _write_location(writer: Writer, log: Log) -> None:
    gps = log.entries.get("/gps")
    if not gps:
        return
    channel = _channel(writer, LOCATION, str(LOCATION_FIX["title"]), LOCATION_FIX)
    fields = np.stack([values(gps, name) for name in FIX], axis=1)
    two_dimensional = 2
    usable = is_good(gps) & np.isfinite(fields[:, :3]).all(axis=1) & (values(gps, "fix_type") >= two_dimensional)
    for time_ns, (latitude, longitude, height, across, up) in zip(
        times_ns(gps)[usable].tolist(), fields[usable].tolist(), strict=True
    ):
        finite = np.isfinite(across) and np.isfinite(up)
        # The accuracy is for both horizontal directions combined.
        diagonal = [across**2 / 2, across**2 / 2, up**2] if finite else [0.0] * 3
        fix = {
            "timestamp": {"sec": time_ns // 10**9, "nsec": time_ns % 10**9},
            "frame_id": "gps",
            "latitude": latitude,
            "longitude": longitude,
            "altitude": height,
            "position_covariance": np.diag(diagonal).ravel().tolist(),
            "position_covariance_type": 2 if finite else 0,
        }
        _add(writer, channel, time_ns, fix)


def _channel(writer: Writer, topic: str, name: str, schema: Mapping[str, Any]) -> int:
    number = writer.register_schema(name=name, encoding="jsonschema", data=msgspec.json.encode(schema))
    channel: int = writer.register_channel(topic=topic, message_encoding="json", schema_id=number)
    return channel


def _add(writer: Writer, channel: int, time_ns: int, message: Mapping[Any, Any]) -> None:
    writer.add_message(channel, log_time=time_ns, publish_time=time_ns, data=msgspec.json.encode(message))
