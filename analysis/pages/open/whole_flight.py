"""A flight whose curve comes from its energy balance: from an autopilot, a table, or a log without sensors for drag.

The user types weight and size next to the curve; until then, guesses from the flight are used. The user can leave out
stretches.
"""

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec

from flightpower.analysis.files import write_file, write_keeping_previous
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate
from flightpower.analysis.methods.whole_flight.guess import guessed_aircraft
from flightpower.analysis.options import LEFT_OUT, Options, read_stretches, stretches_text
from flightpower.analysis.pages.open import form
from flightpower.analysis.pages.open.opened import (
    OpenedFlight,
    columns,
    condition_at,
    curve_json,
    report_folder,
    shares,
)
from flightpower.analysis.pages.open.pictures import (
    Stretch,
    curve_chart,
    map_chart,
    rows_of_recording,
    strips,
    track_of,
)
from flightpower.analysis.pages.open.request import FieldError, Json, Values
from flightpower.analysis.pipeline import analyze
from flightpower.analysis.pipeline.whole_flight import WholeFlightAnalysis
from flightpower.analysis.records.flight import Kind
from flightpower.analysis.results.read import read_results
from flightpower.analysis.sources import autopilot, daemon, recording
from flightpower.analysis.sources.daemon import times_ns
from flightpower.analysis.sources.daemon_recording import recording_of
from flightpower.analysis.sources.recognize import autopilot_of
from flightpower.analysis.sources.recording import AllChannels, Channel, Event, FlightRecording
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log
from flightpower.flight.shipped_propellers import shipped_propellers
from flightpower.flight.units import GRAVITY_MPS2

AIRBORNE = "in the curve"


class WholeFlight(OpenedFlight):
    """A log whose curve comes from the energy balance of its whole flight."""

    kind = Kind.ELECTRICAL

    def __init__(self, path: Path, workspace: Path, source: Log | FlightRecording):
        super().__init__(path, workspace)
        self.source = source

    @cached_property
    def recording(self) -> FlightRecording:
        return recording_of(self.source) if isinstance(self.source, Log) else self.source

    @cached_property
    def aircraft_keys(self) -> Json:
        """Keys and values of the log's aircraft file; empty if it has none."""
        return form.aircraft_keys(self.source) if isinstance(self.source, Log) else {}

    @cached_property
    def shown(self) -> Json:
        groups = (
            form.aircraft_form(self.aircraft_keys, form.OF_WHOLE_FLIGHTS) if self.aircraft_keys else form.options_form()
        )
        return {
            "file": self.path.name,
            "kind": self.kind,
            "command": self.command(Values("")),
            "form": groups,
            "strips": self.strips({}),
            "events": [self._from_start(event)._asdict() for event in self.recording.events],
            "propellers": shipped_propellers(),
            "propeller": self.aircraft_keys.get("propulsion.propeller", ""),
            "remembered": {} if self.aircraft_keys else remembered(report_folder(self.path)),
            "left_out": self._remembered_stretches(),
            "needed": {} if self.aircraft_keys else {key: form.OPTIONS[key].label for key in form.NEEDED},
            "end_s": self.end_s,
        }

    def _remembered_stretches(self) -> list[tuple[float, float]]:
        """Return the stretches [s] that the last report left out; none if its list cannot be used with this log."""
        try:
            stretches = list(read_stretches(report_folder(self.path) / LEFT_OUT, "left out"))
            self._left_out(Values("", left_out=stretches))
        except InputError:
            return []
        return stretches

    @cached_property
    def start_s(self) -> float:
        """Time of the first airspeed, or else of the first GPS velocity, where the flight's table starts as well."""
        channels = self.recording.channels
        main = channels.get(recording.AIRSPEED_PRESSURE, channels.get(recording.GPS[0]))
        return float(main.t_s[0]) if main is not None and len(main.t_s) else 0.0

    @cached_property
    def end_s(self) -> float:
        ends = [float(channel.t_s[-1]) for channel in self.recording.channels.values() if len(channel.t_s)]
        return max([end - self.start_s for end in ends], default=1.0)

    @cached_property
    def channels(self) -> AllChannels:
        if isinstance(self.source, Log):
            first = next(topic for topic in ("/probe/airspeed", "/gps") if self.source.entries.get(topic))
            return daemon.all_channels(self.source, int(times_ns(self.source.entries[first])[0]))
        kind = autopilot_of(self.path)
        return {} if kind is None else autopilot.all_channels(self.path, kind)

    def strips(self, channels: dict[str, Channel]) -> str:
        rows = rows_of_recording(self.recording, self.start_s)
        shifted = {name: Channel(channel.t_s - self.start_s, channel.value) for name, channel in channels.items()}
        return strips(rows, shifted, [self._from_start(event) for event in self.recording.events], self.end_s)

    def _from_start(self, event: Event) -> Event:
        return event._replace(t_s=event.t_s - self.start_s)

    def _curve(self, values: Values) -> Json:
        guessed = self._guessed(values)
        options = self._options(values, self.workspace, guessed)
        if values.aircraft and self.aircraft_keys:
            write_file(
                self.workspace / "aircraft.toml",
                form.aircraft_text(self.aircraft_keys, values, self.path.name).encode(),
            )
        done = analyze(self.source, options)
        assert isinstance(done, WholeFlightAnalysis)
        estimate, flight = done.estimate, done.flight
        curve = estimate.curve.at(condition_at(estimate.curve.condition, values.other_condition))
        points = curve.points()
        middle = len(points) // 2
        seconds = flight.table.index.to_numpy()
        airborne = [[float(seconds[rows.start]), float(seconds[rows.stop - 1])] for rows in flight.airborne]
        path = track_of(self.recording, flight.start_s, float(seconds[-1]))
        wind = (estimate.airspeed.wind_mps, estimate.airspeed.wind_from_deg)
        stretches = [Stretch(AIRBORNE, start, end) for start, end in airborne]
        return curve_json(curve) | {
            "guessed": {key: f"{value:.2g} {form.OPTIONS[key].unit}" for key, value in guessed.items()},
            "airborne": airborne,
            "required": columns(done.results.power_required) if done.results.power_required else None,
            "sources": shares(_variances(estimate, middle)),
            "sources_at_mps": points[middle].speed_mps,
            "track": msgspec.to_builtins(path),
            "figures": {
                "curve": curve_chart(self.kind, points, estimate if values.other_condition is None else None),
                "track": path and map_chart(path, stretches, wind),
            },
            "notes": list(done.results.warnings),
            "command": self.command(values),
        }

    def _guessed(self, values: Values) -> dict[str, float]:
        """Return guesses for required values that the user has not typed, in SI units by key of the form."""
        missing = [key for key in form.NEEDED if not values.aircraft.get(key, "").strip()]
        if self.aircraft_keys or not missing:
            return {}
        guess = guessed_aircraft(self.recording)
        guesses = {
            "mass": guess.weight_N / GRAVITY_MPS2, "wing-area": guess.wing_area_m2, "span": guess.span_m,
        }  # fmt: skip
        return {key: guesses[key] for key in missing}

    def _options(self, values: Values, folder: Path, guessed: dict[str, float] | None = None) -> Options:
        options: Json = {"leave_out": self._left_out(values) or None}
        if form.shipped(values.propeller):
            options["propeller"] = values.propeller
        if self.aircraft_keys:
            if values.aircraft:
                form.check_fields(self.aircraft_keys, values, self.path.name)
                options["aircraft"] = folder / "aircraft.toml"
            return Options(**options)
        options |= form.option_values(values.aircraft)
        for key in form.NEEDED:
            option = form.OPTIONS[key]
            if options.get(option.field) is None:
                if not guessed:
                    raise FieldError(f"{option.label}: is only guessed; type it, such as {option.example}", key)
                options[option.field] = guessed[key]
        return Options(**options)

    def _left_out(self, values: Values) -> str:
        """Return the stretches as --leave-out takes them. Raises FieldError for an empty one or one outside the log."""
        for i, (start_s, end_s) in enumerate(values.left_out):
            if not 0 <= start_s < end_s <= self.end_s + 1:
                raise FieldError(
                    f"{start_s:g} to {end_s:g} s: the start must lie before the end, and both in the log, from 0 to"
                    f" {self.end_s:.0f} s",
                    f"run {i}",
                )
        return stretches_text(values.left_out)

    def _words(self, values: Values, folder: Path) -> list[str]:
        if self.aircraft_keys:
            words = ["--aircraft", str(folder / "aircraft.toml")] if values.aircraft else []
        else:
            words = [word for key, text in values.aircraft.items() if text for word in (f"--{key}", text)]
        if values.propeller:
            words += ["--propeller", values.propeller]
        if values.left_out:
            words += ["--leave-out", stretches_text(values.left_out)]
        return words

    def _write_inputs(self, values: Values, folder: Path) -> Iterator[Path | None]:
        if values.aircraft and self.aircraft_keys:
            folder.mkdir(exist_ok=True)
            yield write_keeping_previous(
                folder / "aircraft.toml", form.aircraft_text(self.aircraft_keys, values, self.path.name)
            )


def remembered(report: Path) -> dict[str, str]:
    """Return mass, wing area, span and battery of a log's last report, as typed; empty if there is none."""
    try:
        results = read_results(report / "results.json")
    except InputError:
        return {}
    battery = {"battery-Wh": f"{results.battery.energy_Wh:.4g}"} if results.battery else {}
    return battery | {
        "mass": f"{results.test.weight_N / GRAVITY_MPS2:.4g} kg",
        "wing-area": f"{results.aircraft.wing_area_m2:.4g} m^2",
        "span": f"{results.aircraft.span_m:.4g} m",
    }


def _variances(estimate: ElectricalEstimate, index: int) -> dict[str, Any]:
    """Return variances of power at one speed, from noise and from each error shared with other flights."""
    power = estimate.curve.power_W
    by_shared = {str(source): float(change[index]) ** 2 for source, change in power.shared.items()}
    return {"motion of the air, and what the flight cannot separate": float(power.own[index, index]), **by_shared}
