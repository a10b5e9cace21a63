"""The flights of the folder that was opened: what the page shows of each, and what an edit changes.

Reading, synchronizing and reconstructing are done once for each set of values; another list of runs is a matter of the
regression alone. The files are written by the function that the command `analyze` calls.
"""

import json
import os
import re
import shlex
import time
import tomllib
from collections.abc import Collection, Iterator, Mapping
from concurrent.futures import BrokenExecutor, Future
from contextlib import suppress
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pandas as pd

from analysis.air.contents import Replacements
from analysis.curve import Condition, Cost
from analysis.files import write_file, write_keeping_previous
from analysis.flight import FlightPath, Measured, flight_path, reconstructed, recorded, synchronized, with_runs
from analysis.maneuvers.kinds import KINDS, Maneuvers
from analysis.maneuvers.runs_file import NoCurve, head
from analysis.options import Options
from analysis.pages.charts.figure import Axis, Figure
from analysis.pages.charts.flight import ground_track, over_time
from analysis.pages.charts.style import BLUE, band, curve_arrays, curve_lines, true_airspeed
from analysis.pages.charts.svg import chart
from analysis.pages.one_log import Report
from analysis.records.flight import PowerPoint, SpeedInterval
from analysis.sources.daemon_log import lacks_drag_topics
from analysis.sources.open import SUFFIXES
from analysis.sources.recognize import autopilot_of
from flight.aircraft import parse_aircraft
from flight.aircraft_keys import KEYS
from flight.command_line import quantity
from flight.errors import InputError
from flight.log_reader import Log, read_log
from flight.propeller_files import load_propeller
from flight.shipped_propellers import shipped_propellers
from flight.units import GRAVITY_MPS2

Json = dict[str, Any]
POLARS = (".txt", ".csv", ".dat")


class Kind(StrEnum):
    """What a log gives: a curve of drag, whose runs can be edited, or electrical power of the whole flight."""

    DRAG = "drag"
    ELECTRICAL = "electrical"
    AUTOPILOT = "autopilot"


class Run(msgspec.Struct, forbid_unknown_fields=True):
    """A stretch of the flight as the page has it. why : what it is left out for, and other remarks"""

    kind: str
    start_s: float
    end_s: float
    keep: bool
    why: str = ""


class Values(msgspec.Struct, forbid_unknown_fields=True):
    """What is asked for in place of what the log has.

    runs : None where they are to be found in the data     aircraft : keys of the aircraft file, by name, as typed
    propeller : the name of a shipped one; "" for that of the log
    at : mass [kg] and air density [kg/m^3] of the curve, of another flight to compare with; None for those flown
    method : name of one whose curve is asked for beside that of the report; "" for none
    polar : name of a file with a predicted polar, to draw beside it; "" for none
    """

    file: str
    runs: list[Run] | None = None
    aircraft: dict[str, str] = {}
    propeller: str = ""
    at: tuple[float, float] | None = None
    method: str = ""
    polar: str = ""


class Limits(NamedTuple):
    """Of what the page may ask: bytes of a dropped log, and of a request or a polar; runs and keys in it; points of a
    strip and its height; curves that are kept of a flight, for who goes back to what was there before."""

    log_bytes: int = 500_000_000
    request_bytes: int = 200_000
    entries: int = 500
    points: int = 1500
    strip_px: int = 96
    curves: int = 10


LIMITS = Limits()
# Keys that the form offers although the file lacks them: a value makes the interval narrower, or gives an answer.
OFFERED = ("imu_position", "probe.position", "probe.upwash_per_CL", "propulsion.battery_energy")
NAME = re.compile(r"[\w(+-][\w .()+-]{0,120}", re.ASCII)


class Folder:
    """The folder that was opened.

    workspace : for files that the analysis reads while the user edits     reading : logs that are being read, by name
    """

    def __init__(self, path: Path, workspace: Path, reading: Mapping[str, Future[Log]] = {}):
        self.path, self.workspace = path, workspace
        self._reading = dict(reading)
        self._opened: dict[str, OpenedFlight] = {}

    def logs(self) -> dict[str, Path]:
        """The logs in the folder by name; links that lead out of it are left out."""
        return _files(self.path, SUFFIXES)

    def polars(self) -> list[str]:
        """Names of the files in the folder that hold a predicted polar."""
        return [name for name, path in _files(self.path, POLARS).items() if _is_polar(path)]

    def flight(self, name: str) -> "OpenedFlight":
        """Raises InputError where there is no such log in the folder, or it cannot be read."""
        path = self.logs().get(name)
        if path is None:
            raise InputError(f"{name[:80]}: no such log in {self.path}")
        opened = self._opened.get(name)
        if opened is None or opened.changed():
            self._opened.pop(name, None)
            while len(self._opened) > 1:  # in memory are the last two, which may be compared
                self._opened.pop(next(iter(self._opened)))
            opened = self._opened[name] = OpenedFlight(path, self.workspace, self._reading.pop(name, None))
        return opened

    def report(self, name: str) -> bytes:
        """The report of a log that was written. Raises InputError where there is none."""
        path = self.logs().get(name)
        page = path and report_folder(path) / "report.html"
        if page is None or not page.is_file() or page.resolve().parent.parent != self.path.resolve():
            raise InputError(f"{name[:80]}: has no report yet")
        return page.read_bytes()

    def listed(self) -> list[Json]:
        """Names, sizes, and whether there is a report, the newest log first."""
        logs = sorted(self.logs().values(), key=lambda path: -path.stat().st_mtime)
        return [
            {"name": path.name, "MB": round(path.stat().st_size / 1e6, 1),
             "report": (report_folder(path) / "report.html").is_file()}
            for path in logs
        ]  # fmt: skip

    def new_file(self, name: str) -> Path:
        """Where a dropped file goes. Raises InputError for a name in use, or of neither a log nor a polar."""
        if not NAME.fullmatch(name) or Path(name).suffix.lower() not in (*SUFFIXES, *POLARS):
            raise InputError(
                f"{name[:80]!r}: is not the name of a log ({', '.join(SUFFIXES)}) or of a polar ({', '.join(POLARS)})"
            )
        if (self.path / name).exists():
            raise InputError(f"{name}: is in the folder already; rename the file that you drop")
        return self.path / name


def _files(folder: Path, suffixes: Collection[str]) -> dict[str, Path]:
    """The files with such a suffix in a folder, by name; links that lead out of it are left out."""
    inside = folder.resolve()
    found = (path for path in sorted(folder.iterdir()) if path.suffix.lower() in suffixes and path.is_file())
    return {path.name: path for path in found if path.resolve().parent == inside}


def _is_polar(path: Path) -> bool:
    from analysis.pages.predicted_polar import read_predicted_polar

    if path.stat().st_size > LIMITS.request_bytes:
        return False
    try:
        return bool(read_predicted_polar(path))
    except InputError:
        return False


def report_folder(log: Path) -> Path:
    """Where `analyze` writes by default."""
    return log.parent / f"{log.stem}.report"


class _Prepared(NamedTuple):
    """What does not depend on the runs. path : None until a curve is asked for"""

    measured: Measured
    path: FlightPath | None


class OpenedFlight:
    """One log, with what was computed of it so far.

    workspace : a folder for the list of runs while it is edited     reading : the log, if another process reads it
    """

    def __init__(self, path: Path, workspace: Path, reading: Future[Log] | None = None):
        self.path, self.workspace, self._reading = path, workspace, reading
        self._stat = _stat(path)
        self._prepared: dict[tuple[str, str], _Prepared] = {}
        self._curves: dict[bytes, Json] = {}  # by what was asked

    def changed(self) -> bool:
        return _stat(self.path) != self._stat

    @cached_property
    def kind(self) -> Kind:
        if autopilot_of(self.path):
            return Kind.AUTOPILOT
        return Kind.ELECTRICAL if lacks_drag_topics(self.log) else Kind.DRAG

    @cached_property
    def log(self) -> Log:
        reading, self._reading = self._reading, None
        with suppress(BrokenExecutor):
            if reading:
                return reading.result()
        return read_log(self.path)

    @cached_property
    def aircraft_keys(self) -> dict[str, str]:
        """The keys of the log's aircraft file, each as it is typed."""
        text = self.log.attachments.get("aircraft.toml", b"").decode("utf-8", errors="replace")
        try:
            table = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise InputError(f"{self.path}: aircraft.toml: not valid TOML ({error})") from None
        return {key: _typed(value) for key, value in _leaves(table)}

    @cached_property
    def shown(self) -> Json:
        """Kind, time histories, runs and values of the flight as recorded."""
        about: Json = {"file": self.path.name, "kind": self.kind, "kinds": KINDS, "command": self.command(Values(""))}
        if self.kind is Kind.AUTOPILOT:
            return about | {"form": [_field("mass", "", ""), _field("wing area", "", ""), _field("span", "", "")]}
        keys = self.aircraft_keys | {key: "" for key in OFFERED if key not in self.aircraft_keys}
        about |= {"form": [_field(key, value, _meaning(key)) for key, value in keys.items()]}
        if self.kind is Kind.ELECTRICAL:
            return about
        measured = self._measured(Values(""))
        return about | {
            "strips": _strips(measured.table),
            "runs": self._found(measured),
            "propellers": shipped_propellers(),
            "propeller": measured.propeller.name,
        }

    def curve(self, values: Values) -> Json:
        """The curve by the dynamic method, or by the best other one, as the report will have it. Raises InputError."""
        asked = msgspec.json.encode(values)
        if asked not in self._curves:
            found = self._curve(values)
            while len(self._curves) >= LIMITS.curves:
                self._curves.pop(next(iter(self._curves)))
            self._curves[asked] = found
        return self._curves[asked]

    def _curve(self, values: Values) -> Json:
        from analysis.methods.interval_sources import variance_by_source
        from analysis.methods.ladder import estimate, estimate_by_runs  # the first picture does not wait for these
        from analysis.pages.open.methods import listed, method_curve
        from analysis.results.curves import power_curve
        from analysis.results.flight_found import track

        began = time.process_time()
        measured = self._measured(values)
        path = self._path(values, measured)
        runs_file = self._runs_file(values, self.workspace / "runs.toml")
        flight = reconstructed(with_runs(measured, runs_file), path)
        main, headline, _ = estimate_by_runs(flight)
        flown_CL = flight.flown_CL
        if main is None:
            drag = estimate(flight)
            main, flown_CL, headline = drag.main, drag.flown_CL, drag.ladder[-1]
        condition = _at(flight.condition, values.at)
        curve = power_curve(main.polar, condition, flown_CL, (flight.rows_flown, flight.condition))
        points = curve.points()
        at = points[len(points) // 2].speed_mps
        variances = variance_by_source(main, flight.aircraft, condition, np.array([at]))
        whole = sum(float(variance[0]) for variance in variances.values())
        path_flown = track(flight.trajectory)
        from_above = ground_track(path_flown, flight.maneuvers.maneuvers, None) if path_flown else None
        other = method_curve(flight, values.method, condition, flown_CL[1]) if values.method else None
        return {
            "curve": _columns(points),
            "headline": headline.title,
            "methods": listed(flight.maneuvers.maneuvers, headline.name),
            "method": other
            and {
                "name": other.name,
                "title": other.title,
                "curve": _columns(other.power_required),
                "notes": other.notes,
            },
            "least_power": _speed(curve.best(Cost.POWER)),
            "mass_kg": condition.weight_N / GRAVITY_MPS2,
            "density_kgpm3": condition.rho,
            "sources": [[source, float(variance[0]) / whole] for source, variance in variances.items()],
            "sources_at_mps": at,
            "predicted": self._predicted(values, condition, points, flight.aircraft.aspect_ratio),
            "runs": _runs(flight.maneuvers),
            "track": msgspec.to_builtins(path_flown),
            "figures": {"curve": _curve_chart(points), "track": from_above and chart(from_above, "track")},
            "notes": [*flight.notes, *main.warnings],
            "command": self.command(values),
            "seconds": time.process_time() - began,
        }

    def write(self, values: Values) -> Json:
        """Write what `analyze` writes, and return what it says. Raises InputError; then no result was written."""
        from analysis.pages.one_log import analyze_log

        folder = report_folder(self.path)
        if self.kind is Kind.DRAG:
            self.curve(msgspec.structs.replace(values, method=""))  # what is wrong is said before anything is written
        options = self._options(values, folder)
        kept = [path.name for path in self._write_inputs(values, folder) if path]
        done = analyze_log(self.path, folder, options, lambda _: None, self.command(values))
        return {"said": _said(done), "kept": kept, "command": self.command(values)}

    def command(self, values: Values) -> str:
        """That gives the same files."""
        words = ["analyze", os.path.relpath(self.path)]
        folder = report_folder(Path(os.path.relpath(self.path)))
        if self.kind is Kind.AUTOPILOT:
            words += [word for key, text in values.aircraft.items() for word in (f"--{key.replace(' ', '-')}", text)]
            return shlex.join(words)
        if values.aircraft:
            words += ["--aircraft", str(folder / "aircraft.toml")]
        if values.propeller:
            words += ["--propeller", values.propeller]
        if values.runs is not None and self.kind is Kind.DRAG:
            words += ["--runs", str(folder / "runs.toml")]
        if values.polar:
            words += ["--polar", os.path.relpath(self.path.parent / values.polar)]
        if _by_likelihood(values.method):
            words += ["--likelihood"]
        return shlex.join(words)

    def aircraft_text(self, values: Values) -> str:
        """The aircraft file with the values of the page. Raises InputError for a key that there is none of."""
        unknown = [key for key in values.aircraft if key not in {*self.aircraft_keys, *OFFERED}]
        if unknown:
            raise InputError(f"{unknown[0][:60]!r}: no such key in the aircraft file of {self.path.name}")
        keys = {key: text for key, text in (self.aircraft_keys | values.aircraft).items() if text.strip()}
        return "".join(f"{key} = {_toml(text)}\n" for key, text in keys.items())

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
            aircraft = parse_aircraft(key[0], "aircraft file") if values.aircraft else None
            if values.propeller and values.propeller not in shipped_propellers():
                raise InputError(f"propeller {values.propeller[:60]!r}: none that `flightpower propellers` lists")
            propeller = load_propeller(values.propeller) if values.propeller else None
            flight = recorded(self.log, Replacements(aircraft=aircraft, propeller=propeller))
            while len(self._prepared) > 2:  # as recorded, the last and this one
                self._prepared.pop(list(self._prepared)[1])
            self._prepared[key] = _Prepared(synchronized(flight), None)
        return self._prepared[key]

    def _found(self, measured: Measured) -> list[Json]:
        try:
            return _runs(with_runs(measured, None).maneuvers)
        except NoCurve as error:
            return _runs(error.maneuvers)

    def _runs_file(self, values: Values, path: Path) -> Path | None:
        """The list of runs as a file. Raises InputError for a kind that there is none of."""
        if values.runs is None:
            return None
        write_file(path, runs_text(values.runs, self.path.name).encode())
        return path

    def _polar_file(self, name: str) -> Path:
        path = _files(self.path.parent, POLARS).get(name)
        if path is None:
            raise InputError(f"{name[:80]}: no such file with a polar in {self.path.parent}")
        return path

    def _predicted(
        self, values: Values, condition: Condition, points: list[PowerPoint], aspect_ratio: float
    ) -> Json | None:
        """The curve by a predicted polar, a tenth of speed beyond the measured one on both sides. Raises InputError."""
        from analysis.pages.predicted_polar import check_of_aircraft, read_predicted_polar

        if not values.polar:
            return None
        predicted = read_predicted_polar(self._polar_file(values.polar))
        check_of_aircraft(predicted, aspect_ratio)
        V = np.linspace(0.9 * points[0].speed_mps, 1.1 * points[-1].speed_mps, len(points))
        return {"name": predicted.name, "speed_mps": V, "power_W": predicted.power_W(V, condition)}

    def _options(self, values: Values, folder: Path) -> Options:
        if self.kind is Kind.AUTOPILOT:
            return Options(**_autopilot_options(values.aircraft))
        edited = values.runs is not None and self.kind is Kind.DRAG
        return Options(
            aircraft=folder / "aircraft.toml" if values.aircraft else None,
            propeller=values.propeller or None,
            runs=folder / "runs.toml" if edited else None,
            likelihood=_by_likelihood(values.method),
            polar=self._polar_file(values.polar) if values.polar else None,
        )

    def _write_inputs(self, values: Values, folder: Path) -> Iterator[Path | None]:
        """The files that the command names; yields where other content of theirs is kept."""
        if self.kind is Kind.AUTOPILOT:
            return
        folder.mkdir(exist_ok=True)
        if values.aircraft:
            yield write_keeping_previous(folder / "aircraft.toml", self.aircraft_text(values))
        if values.runs is not None and self.kind is Kind.DRAG:
            yield write_keeping_previous(folder / "runs.toml", runs_text(values.runs, self.path.name))


def runs_text(runs: Collection[Run], log: str) -> str:
    """`runs.toml` of the runs of the page. Raises InputError for a kind that there is none of, or an endless time."""
    text = head(log)
    for run in sorted(runs, key=lambda run: run.start_s):
        if run.kind not in KINDS or not np.isfinite([run.start_s, run.end_s]).all():
            raise InputError(f"run {run.kind[:40]!r}, {run.start_s} to {run.end_s} s: not a run of {', '.join(KINDS)}")
        text += (
            f'\n[[run]]\nkind = "{run.kind}"\nstart = "{run.start_s:.2f} s"\nend = "{run.end_s:.2f} s"\n'
            f"keep = {json.dumps(run.keep)}\n"
        )
    return text


def _stat(path: Path) -> tuple[int, int]:
    found = path.stat()
    return found.st_mtime_ns, found.st_size


def _leaves(table: Json, section: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{section}{key}.")
        else:
            yield section + key, value


def _typed(value: object) -> str:
    """A value of a TOML file as it is typed into the form: text without quotation marks."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def _toml(text: str) -> str:
    """What was typed as a TOML value: numbers, lists, true and false as such, all else as text."""
    try:
        value = tomllib.loads(f"value = {text}")
        if len(value) == 1 and isinstance(value["value"], bool | int | float | list):
            return json.dumps(value["value"], ensure_ascii=False)
    except (tomllib.TOMLDecodeError, ValueError):
        pass
    return json.dumps(text, ensure_ascii=False)


def _field(key: str, value: str, meaning: str) -> Json:
    return {"key": key, "value": value, "meaning": meaning}


def _meaning(key: str) -> str:
    entry = KEYS.get(key)
    if entry is None:
        return ""
    return f"{entry.meaning} {entry.measure}" + (f" Without it: {entry.without}." if entry.without else "")


def _strips(table: pd.DataFrame) -> str:
    """Time histories one above the other, without those of which the log has nothing."""
    t_s = table.index.to_numpy()
    rows = (
        (table["V_mps"], Axis("speed", "m/s")),
        (table["height_m"], Axis("height", "m")),
        (60 * table["n_revps"], Axis("motor", "rpm")),
        (100 * table["throttle"], Axis("throttle", "%")),
        (np.degrees(table["alpha_rad"]), Axis("angle of attack", "deg")),
        (np.degrees(table["bank_rad"]), Axis("bank", "deg")),
    )
    known = [(t_s, column.to_numpy(), axis) for column, axis in rows if column.notna().any()]
    figure = over_time(known, LIMITS.points)
    figure.height_px = LIMITS.strip_px * len(known) + 60
    return chart(figure, "strips", "The flight over time, with its runs")


def _curve_chart(points: list[PowerPoint]) -> str:
    """Power required with its interval; the page adds the curves beside it."""
    V, _, lo, hi = curve_arrays(points)
    name = "power required"
    figure = Figure(height_px=380, x=true_airspeed())
    figure.y = Axis(name, "W", limits=(0, 1.08 * float(np.max(hi))))
    figure.add(band(V, (lo, hi), BLUE, 0.3, name=name), *curve_lines(points, name, BLUE, width=4))
    return chart(figure, "curve", "Power required against airspeed, with its 95 % interval")


def _runs(maneuvers: Maneuvers) -> list[Json]:
    """In order of time; those that are not used with the reason."""
    runs = [Run(run.kind, run.start_s, run.end_s, True, "; ".join(run.notes)) for run in maneuvers.maneuvers]
    runs += [Run(one.kind, one.start_s, one.end_s, False, one.reason) for one in maneuvers.rejected]
    found: list[Json] = msgspec.to_builtins(sorted(runs, key=lambda run: run.start_s))
    return found


def _at(flown: Condition, asked: tuple[float, float] | None) -> Condition:
    """Raises InputError for a mass or density that nothing flies at."""
    if asked is None:
        return flown
    mass_kg, rho = asked
    if not (0 < mass_kg < 1000 and 0 < rho < 2):
        raise InputError(f"mass {mass_kg:g} kg in air of {rho:g} kg/m³: no flight to compare at")
    return flown._replace(weight_N=mass_kg * GRAVITY_MPS2, rho=rho)


def _by_likelihood(method: str) -> bool:
    if not method:
        return False
    from analysis.pages.open.methods import by_likelihood

    return by_likelihood(method)


def _columns(points: list[PowerPoint]) -> Json:
    names = ("speed_mps", "power_W", "power_lo_W", "power_hi_W")
    return {name: [getattr(point, name) for point in points] for name in names}


def _speed(found: SpeedInterval) -> float | None:
    return found.speed_mps if found.inside_flown_range else None


def _autopilot_options(given: dict[str, str]) -> Json:
    """Fields of `Options` from the texts of the form. Raises InputError."""
    parsers = {
        "mass": ("mass_kg", quantity("mass", "kg", '"9 lb"', above=0, most=1000)),
        "wing area": ("wing_area_m2", quantity("wing area", "m^2", '"5 ft^2"', above=0, most=200)),
        "span": ("span_m", quantity("span", "m", '"13 ft"', above=0, most=100)),
    }
    unknown = [key for key in given if key not in parsers]
    if unknown:
        raise InputError(f"{unknown[0][:60]!r}: not a value of the form")
    return {parsers[key][0]: parsers[key][1](text) for key, text in given.items() if text.strip()}


def _said(done: Report) -> list[str]:
    """The verdict, and what was replaced."""
    results = done.results
    return [f"{results.aircraft.title}: {results.trust}"] + ([done.replaced_report] if done.replaced_report else [])
