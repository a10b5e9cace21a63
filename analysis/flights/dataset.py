"""Statistics of flights as rows of a Parquet dataset, partitioned by airframe, at any place that fsspec can reach.

A row holds a few kilobytes of a flight's `results.json`, which a pool reads, and the columns by which flights are
chosen. Files are added and never changed: an addition writes one file for each airframe, named by its content. A flight
added twice counts once, and the order of additions does not matter.
"""

import hashlib
import math
import os
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple
from urllib.parse import quote, unquote

import msgspec

from flightpower.analysis.flights.campaign.addresses import file_system, is_address
from flightpower.analysis.flights.flight_statistics import (
    FlightCurve,
    PoolFlight,
    of_content,
    read_curve,
    read_statistics,
    without_details,
)
from flightpower.analysis.records.flight import FORMAT, POOLING_FORMAT, Results
from flightpower.analysis.results.read import read_results
from flightpower.flight.errors import InputError

if TYPE_CHECKING:
    import pyarrow as pa


class Added(NamedTuple):
    """Number of flights that were new, and number of flights that the dataset already had."""

    new: int
    already_there: int


class StoredFlight(NamedTuple):
    """flight: fingerprint of its estimates     configuration: fingerprint of what flights of one pool have in common
    folder: folder of its report
    """

    flight: str
    configuration: str
    start_unix_s: float | None
    content: Results
    folder: str = ""


@dataclass(frozen=True)
class Dataset:
    """The rows below a folder or an address such as s3://bucket/fleet.

    Raises InputError if the file system is not known or does not answer.
    """

    address: str

    def add(self, results: Iterable[Mapping[str, Any] | Results], folders: Mapping[str, Path] = {}) -> Added:
        """Add the contents of results.json. Flights already in the dataset are skipped.

        folders: folders of the flights' reports, by the name of the log. A dataset in a folder keeps them as relative
        paths, so that both can be moved together; a dataset at an address does not keep them
        """
        new: dict[str, list[StoredFlight]] = defaultdict(list)
        count = 0
        for content in results:
            flight = stored(content)
            flight = flight._replace(folder=self._relative(folders.get(flight.content.log)))
            new[flight.content.aircraft.name].append(flight)
            count += 1
        added = 0
        for airframe, flights in new.items():
            flight_names = set(self._column(airframe, "flight"))
            fresh = {flight.flight: flight for flight in flights if flight.flight not in flight_names}
            if fresh:
                self._write(airframe, [fresh[key] for key in sorted(fresh)])
                added += len(fresh)
        return Added(added, count - added)

    def _relative(self, folder: Path | None) -> str:
        if folder is None or is_address(self.address):
            return ""
        try:
            return Path(os.path.relpath(folder.resolve(), Path(self.address).resolve())).as_posix()
        except ValueError:  # on a different Windows drive
            return ""

    @property
    def airframes(self) -> list[str]:
        """Names of the airframes, sorted."""
        fs, root = file_system(self.address)
        names = sorted(unquote(path.rsplit("=", 1)[1]) for path in fs.glob(f"{root}/airframe=*"))
        if not names:
            raise InputError(
                f"{self.address}: no fleet's flights there; give the folder or address after --to of"
                " `flightpower fleet add`"
            )
        return names

    def flights(self, airframe: str, unread: list[str] | None = None) -> dict[str, list[PoolFlight]]:
        """Return the flights of an airframe by configuration, sorted by date within each, undated ones last.

        unread: receives a line for each file that cannot be read; if it is None, the first such file raises InputError
        """
        newest: dict[str, tuple[str, PoolFlight]] = {}
        for table in self._tables(airframe, ["flight", "configuration", "format", "content", "folder"], unread):
            for row in table.to_pylist():
                content = _read_row(row)
                if content is not None:
                    flight = read_curve(content) if content.pooling is None else of_content(content)
                    folder = row.get("folder") or ""  # rows of earlier versions lack the folder
                    newest[row["flight"]] = (row["configuration"], replace(flight, folder=folder))
        by_configuration: dict[str, list[PoolFlight]] = defaultdict(list)
        for key in sorted(newest, key=lambda key: (newest[key][1].start_unix_s or math.inf, key)):
            configuration, flight = newest[key]
            by_configuration[configuration].append(flight)
        return dict(by_configuration)

    def _tables(self, airframe: str, columns: list[str], unread: list[str] | None = None) -> Iterator["pa.Table"]:
        import pyarrow as pa
        import pyarrow.parquet as pq

        fs, root = file_system(self.address)
        for path in sorted(fs.glob(f"{_folder(root, airframe)}/*.parquet")):
            try:
                with fs.open(path, "rb") as stream:
                    yield pq.ParquetFile(stream).read(columns=columns)
            except (OSError, pa.ArrowException) as error:
                line = f"{path}: cannot be read ({error}); its flights are left out; remove it and add them again"
                if unread is None:
                    raise InputError(line) from None
                unread.append(line)

    def _column(self, airframe: str, name: str) -> list[str]:
        return [value for table in self._tables(airframe, [name]) for value in table[name].to_pylist()]

    def _write(self, airframe: str, flights: list[StoredFlight]) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        schema = pa.schema(
            [
                ("flight", pa.string()),
                ("log", pa.string()),
                ("configuration", pa.string()),
                ("start_unix_s", pa.float64()),
                ("format", pa.string()),
                ("content", pa.binary()),
                ("folder", pa.string()),
            ]
        )
        rows = [
            {
                "flight": flight.flight,
                "log": flight.content.log,
                "configuration": flight.configuration,
                "start_unix_s": flight.start_unix_s,
                "format": flight.content.format,
                "content": msgspec.msgpack.encode(flight.content),
                "folder": flight.folder,
            }
            for flight in flights
        ]
        name = hashlib.sha256("".join(flight.flight for flight in flights).encode()).hexdigest()[:24]
        fs, root = file_system(self.address)
        folder = _folder(root, airframe)
        fs.makedirs(folder, exist_ok=True)
        with fs.transaction, fs.open(f"{folder}/{name}.parquet", "wb") as stream:  # complete, or not at all
            pq.write_table(pa.Table.from_pylist(rows, schema=schema), stream, compression="zstd")


def stored(results: Mapping[str, Any] | Results) -> StoredFlight:
    """Return a flight's row, without the fields used to compute missions. Raises InputError as `read_statistics`
    does."""
    content = read_results(results)
    if content.pooling is None:
        return _stored_curve(read_curve(content))
    statistics = read_statistics(content)
    of_flight = statistics.statistics
    common = (
        statistics.aircraft.wing_area_m2,
        of_flight.propeller_table,
        of_flight.installation,
        of_flight.probe_calibration,
        msgspec.to_builtins(of_flight.prior_measurements or []),
    )
    content = msgspec.structs.replace(without_details(statistics.content), use=None)
    return StoredFlight(_fingerprint(of_flight.values), _fingerprint(common), statistics.start_unix_s, content)


def _stored_curve(flight: FlightCurve) -> StoredFlight:
    """Return the row of a flight that gives electrical power only; same size and autopilot make one configuration."""
    aircraft, power = flight.aircraft, flight.curve.power_W.value
    common = (flight.curve.kind, aircraft.wing_area_m2, aircraft.span_m, flight.content.vehicle)
    content = without_details(flight.content)
    return StoredFlight(_fingerprint(power.tolist()), _fingerprint(common), flight.start_unix_s, content)


def _read_row(row: Mapping[str, Any]) -> Results | None:
    """Return a row's results; None for an unknown format. Earlier versions wrote the format of their statistics."""
    if row["format"] == FORMAT:
        return msgspec.msgpack.decode(row["content"], type=Results)
    if row["format"] == POOLING_FORMAT:
        return read_results(msgspec.msgpack.decode(row["content"], type=dict[str, Any]))
    return None


def _fingerprint(value: Any) -> str:
    return hashlib.sha256(msgspec.msgpack.encode(value)).hexdigest()[:24]


def _folder(root: str, airframe: str) -> str:
    return f"{root}/airframe={quote(airframe, safe='')}"
