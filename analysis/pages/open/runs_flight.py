"""A flight with the sensors for drag: the user edits its runs and values, and the curve follows.

Reading, synchronizing and reconstructing are done once for each set of values; a changed list of runs requires only a
new regression.
"""

import os
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from flightpower.analysis.air.contents import Replacements
from flightpower.analysis.curve import Condition
from flightpower.analysis.files import write_file, write_keeping_previous
from flightpower.analysis.flight import (
    FlightPath,
    Measured,
    flight_path,
    reconstructed,
    recorded,
    synchronized,
    with_runs,
)
from flightpower.analysis.maneuvers.kinds import KINDS, Maneuvers
from flightpower.analysis.maneuvers.runs_file import ManeuverEntry, NoCurve, entry_text, head, mistake_in, to_toml
from flightpower.analysis.options import Options
from flightpower.analysis.pages.open import form
from flightpower.analysis.pages.open.folder_files import polars_in
from flightpower.analysis.pages.open.opened import (
    OpenedFlight,
    columns,
    condition_at,
    curve_json,
    report_folder,
    shares,
)
from flightpower.analysis.pages.open.pictures import curve_chart, map_chart, rows_of_runs, strips
from flightpower.analysis.pages.open.request import FieldError, Json, Run, Values
from flightpower.analysis.records.flight import Kind, PowerPoint
from flightpower.analysis.sources.daemon import all_channels, events, times_ns
from flightpower.analysis.sources.recording import AllChannels, Channel, in_order
from flightpower.flight.aircraft import parse_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.files import read_text
from flightpower.flight.log_reader import Log
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.shipped_propellers import shipped_propellers


class _Prepared(NamedTuple):
    """Data that do not depend on the runs. path : None until a curve is requested"""

    measured: Measured
    path: FlightPath | None


class RunsFlight(OpenedFlight):
    """A log whose curve comes from its runs."""

    kind = Kind.POWER_REQUIRED

    def __init__(self, path: Path, workspace: Path, log: Log):
        super().__init__(path, workspace)
        self.log = log
        self._prepared: dict[tuple[str, str], _Prepared] = {}

    @cached_property
    def aircraft_keys(self) -> Json:
        """Keys and values of the log's aircraft file."""
        return form.aircraft_keys(self.log)

    @cached_property
    def shown(self) -> Json:
        measured = self._measured(Values(""))
        return {
            "file": self.path.name,
            "kind": self.kind,
            "kinds": KINDS,
            "command": self.command(Values("")),
            "form": form.aircraft_form(self.aircraft_keys),
            "strips": self.strips({}),
            "events": [event._asdict() for event in self._events],
            "runs": self._found(measured),
            "edited_runs": self._edited(measured),
            "propellers": shipped_propellers(),
            "propeller": measured.propeller.name,
        }

    @property
    def _start_ns(self) -> int:
        return int(times_ns(self.log.entries["/imu"])[0])

    @cached_property
    def _events(self) -> Any:
        return in_order(events(self.log, self._start_ns))

    @cached_property
    def channels(self) -> AllChannels:
        return all_channels(self.log, self._start_ns)

    def strips(self, channels: dict[str, Channel]) -> str:
        table = self._measured(Values("")).table
        return strips(rows_of_runs(table), channels, self._events, float(table.index[-1]))

    def _curve(self, values: Values) -> Json:
        from flightpower.analysis.methods.interval_sources import variance_by_source
        from flightpower.analysis.methods.ladder import (  # imported late, so that the first picture need not wait
            estimate,
            estimate_by_runs,
        )
        from flightpower.analysis.pages.open.methods import listed, method_curve
        from flightpower.analysis.results.curves import power_curve
        from flightpower.analysis.results.flight_found import air_found, track

        measured = self._measured(values)
        path = self._path(values, measured)
        runs_file = self._runs_file(values, self.workspace / "runs.toml")
        flight = reconstructed(with_runs(measured, runs_file), path)
        main, headline, _ = estimate_by_runs(flight)
        flown_CL = flight.flown_CL
        if main is None:
            drag = estimate(flight)
            main, flown_CL, headline = drag.main, drag.flown_CL, drag.ladder[-1]
        condition = condition_at(flight.condition, values.other_condition)
        curve = power_curve(main.polar, condition, flown_CL, (flight.rows_flown, flight.condition))
        points = curve.points()
        middle_mps = points[len(points) // 2].speed_mps
        path_flown = track(flight.trajectory)
        air = air_found(flight.trajectory, flight.rows_flown, flight.condition)
        wind = (air.wind_mps, air.wind_from_deg)
        other = method_curve(flight, values.method, condition, flown_CL[1]) if values.method else None
        return curve_json(curve) | {
            "headline": headline.title,
            "methods": listed(flight.maneuvers.maneuvers, headline.name),
            "method": other
            and {
                "name": other.name,
                "title": other.title,
                "curve": columns(other.power_required),
                "notes": other.notes,
            },
            "sources": shares(variance_by_source(main, flight.aircraft, condition, np.array([middle_mps]))),
            "sources_at_mps": middle_mps,
            "predicted": self._predicted(values, condition, points, flight.aircraft.aspect_ratio),
            "runs": _runs(flight.maneuvers),
            "track": msgspec.to_builtins(path_flown),
            "figures": {
                "curve": curve_chart(self.kind, points),
                "track": path_flown and map_chart(path_flown, flight.maneuvers.maneuvers, wind),
            },
            "notes": [*flight.notes, *main.warnings],
            "command": self.command(values),
        }

    def _words(self, values: Values, folder: Path) -> list[str]:
        words = []
        if values.aircraft:
            words += ["--aircraft", str(folder / "aircraft.toml")]
        if values.propeller:
            words += ["--propeller", values.propeller]
        if values.runs is not None:
            words += ["--runs", str(folder / "runs.toml")]
        if values.polar:
            words += ["--polar", os.path.relpath(self.path.parent / values.polar)]
        if _by_likelihood(values.method):
            words += ["--likelihood"]
        return words

    def aircraft_text(self, values: Values) -> str:
        """Return the aircraft file with the values of the page. Raises InputError for an unknown key."""
        return form.aircraft_text(self.aircraft_keys, values, self.path.name)

    def _measured(self, values: Values) -> Measured:
        return self._prepare(values).measured

    def _path(self, values: Values, measured: Measured) -> FlightPath:
        key = (self.aircraft_text(values), values.propeller)
        path = self._prepared[key].path or flight_path(measured)
        self._prepared[key] = _Prepared(measured, path)
        return path

    def _prepare(self, values: Values) -> _Prepared:
        key = (self.aircraft_text(values), values.propeller)
        if key not in self._prepared:
            if values.aircraft:
                form.check_fields(self.aircraft_keys, values, self.path.name)
            aircraft = parse_aircraft(key[0], "aircraft file") if values.aircraft else None
            propeller = load_propeller(values.propeller) if form.shipped(values.propeller) else None
            flight = recorded(self.log, Replacements(aircraft=aircraft, propeller=propeller))
            while len(self._prepared) > 2:  # keeps as recorded, the last and this one
                self._prepared.pop(list(self._prepared)[1])
            self._prepared[key] = _Prepared(synchronized(flight), None)
        return self._prepared[key]

    def _found(self, measured: Measured) -> list[Json]:
        try:
            return _runs(with_runs(measured, None).maneuvers)
        except NoCurve as error:
            return _runs(error.maneuvers)

    def _edited(self, measured: Measured) -> list[Json]:
        """Return the runs of the report's runs.toml if they differ from those found; none if the file is unusable."""
        path = report_folder(self.path) / "runs.toml"
        try:
            maneuvers, text = with_runs(measured, None).maneuvers, read_text(path) if path.is_file() else ""
        except NoCurve as error:
            maneuvers, text = error.maneuvers, read_text(path)
        except InputError:
            return []
        if text in ("", to_toml(maneuvers, self.path.name)):
            return []
        try:
            return _runs(with_runs(measured, path).maneuvers)
        except InputError:  # wrong log, or an invalid edit: the page shows what the analysis found
            return []

    def _runs_file(self, values: Values, path: Path) -> Path | None:
        """Write the list of runs as a file. Raises InputError for an unknown kind."""
        if values.runs is None:
            return None
        write_file(path, runs_text(values.runs, self.path.name).encode())
        return path

    def _polar_file(self, name: str) -> Path:
        path = polars_in(self.path.parent).get(name)
        if path is None:
            raise FieldError(f"{name[:80]}: no such file with a polar in {self.path.parent}", "polar")
        return path

    def _predicted(
        self, values: Values, condition: Condition, points: list[PowerPoint], aspect_ratio: float
    ) -> Json | None:
        """Return the curve from a predicted polar, extended by a tenth of speed beyond both ends. Raises InputError."""
        from flightpower.analysis.pages.predicted_polar import check_of_aircraft, read_predicted_polar

        if not values.polar:
            return None
        predicted = read_predicted_polar(self._polar_file(values.polar))
        check_of_aircraft(predicted, aspect_ratio)
        V = np.linspace(0.9 * points[0].speed_mps, 1.1 * points[-1].speed_mps, len(points))
        return {"name": predicted.name, "speed_mps": V, "power_W": predicted.power_W(V, condition)}

    def _options(self, values: Values, folder: Path) -> Options:
        return Options(
            aircraft=folder / "aircraft.toml" if values.aircraft else None,
            propeller=values.propeller or None,
            runs=folder / "runs.toml" if values.runs is not None else None,
            likelihood=_by_likelihood(values.method),
            polar=self._polar_file(values.polar) if values.polar else None,
        )

    def _write_inputs(self, values: Values, folder: Path) -> Iterator[Path | None]:
        folder.mkdir(exist_ok=True)
        if values.aircraft:
            yield write_keeping_previous(folder / "aircraft.toml", self.aircraft_text(values))
        if values.runs is not None:
            yield write_keeping_previous(folder / "runs.toml", runs_text(values.runs, self.path.name))


def runs_text(runs: Sequence[Run], log: str) -> str:
    """Return `runs.toml` for the runs of the page, in order of time. Raises FieldError for an invalid run."""
    text = head(log)
    for i, run in sorted(enumerate(runs), key=lambda numbered: numbered[1].start_s):
        entry = ManeuverEntry(kind=run.kind, start_s=run.start_s, end_s=run.end_s, keep=run.keep)
        if mistake := mistake_in(entry):
            raise FieldError(f"run {i + 1}: {mistake}", f"run {i}")
        text += entry_text(entry)
    return text


def _runs(maneuvers: Maneuvers) -> list[Json]:
    """Return runs in order of time, unused runs with the reason."""
    runs = [Run(run.kind, run.start_s, run.end_s, True, "; ".join(run.notes)) for run in maneuvers.maneuvers]
    runs += [
        Run(rejected.kind, rejected.start_s, rejected.end_s, False, rejected.reason) for rejected in maneuvers.rejected
    ]
    rows: list[Json] = msgspec.to_builtins(sorted(runs, key=lambda run: run.start_s))
    return rows


def _by_likelihood(method: str) -> bool:
    if not method:
        return False
    from flightpower.analysis.pages.open.methods import by_likelihood

    return by_likelihood(method)
