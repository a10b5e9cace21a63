"""The derived quantities and the position as a second MCAP file, for Foxglove and PlotJuggler beside the log.

Times are those of the log, so that both files can be opened together.
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

from analysis.exports.derived import ERROR, QUANTITIES
from analysis.files import write_file
from analysis.signals.log_fields import is_good, times_ns, values
from flight.log_reader import Log

PROFILE = "flightpower-derived"
LOCATION = "/derived/location"
STATES, RUNS = "/derived/states", "/derived/run"
TOPICS = {name: f"/derived/{name.split('_')[0] if name[0] != 'C' else name}" for name in QUANTITIES}
FIX = ("latitude_deg", "longitude_deg", "height_m", "horizontal_accuracy_m", "vertical_accuracy_m")
LEAST_FIX = 2  # two-dimensional
DIAGONAL_KNOWN = 2
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
    """Write `path`, and the layouts for Foxglove and PlotJuggler beside it. Raises InputError when that fails."""
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
    write_file(path, stream.getvalue())
    for layout in LAYOUTS:
        write_file(path.parent / layout, (resources.files("analysis.exports") / "layouts" / layout).read_bytes())


def _write_table(writer: Writer, topic: str, table: pd.DataFrame, start_ns: int) -> None:
    """One message a row that has a number, with the fields of the table; index: seconds since `start_ns`."""
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
    usable = is_good(gps) & np.isfinite(fields[:, :3]).all(axis=1) & (values(gps, "fix_type") >= LEAST_FIX)
    for time_ns, (latitude, longitude, height, across, up) in zip(
        times_ns(gps)[usable].tolist(), fields[usable].tolist(), strict=True
    ):
        known = np.isfinite(across) and np.isfinite(up)
        # The accuracy is that of both horizontal directions together.
        diagonal = [across**2 / 2, across**2 / 2, up**2] if known else [0.0] * 3
        fix = {
            "timestamp": {"sec": time_ns // 10**9, "nsec": time_ns % 10**9},
            "frame_id": "gps",
            "latitude": latitude,
            "longitude": longitude,
            "altitude": height,
            "position_covariance": np.diag(diagonal).ravel().tolist(),
            "position_covariance_type": DIAGONAL_KNOWN if known else 0,
        }
        _add(writer, channel, time_ns, fix)


def _channel(writer: Writer, topic: str, name: str, schema: Mapping[str, Any]) -> int:
    number = writer.register_schema(name=name, encoding="jsonschema", data=msgspec.json.encode(schema))
    channel: int = writer.register_channel(topic=topic, message_encoding="json", schema_id=number)
    return channel


def _add(writer: Writer, channel: int, time_ns: int, message: Mapping[Any, Any]) -> None:
    writer.add_message(channel, log_time=time_ns, publish_time=time_ns, data=msgspec.json.encode(message))
