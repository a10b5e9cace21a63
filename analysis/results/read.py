"""The only reader of `results.json`, in this format and in earlier ones, whose fields it moves to their new places.

Formats before `flightpower-results-3` had two sets of fields: `power_required`, `minimum_power_speed`, `pooling` … for
flights with runs, and `electrical_power` with `electrical` for others. Pools had the same two sets.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from flightpower.analysis.methods.whole_flight.parameters import DRAG, LIFT, PROPELLER, prior_error
from flightpower.analysis.performance.settings import ASKED
from flightpower.analysis.records.fleet import FORMAT as FLEET_FORMAT
from flightpower.analysis.records.flight import (
    FORMAT,
    POOLING_FORMAT,
    POWER_FORMAT,
    Evidence,
    EvidenceKind,
    Kind,
    Results,
    Trust,
    WithCurves,
)
from flightpower.analysis.records.pool import COMPARISON_FORMAT, EARLIER_POOLED_FORMATS, POOLED_FORMAT, PooledResults
from flightpower.flight.errors import InputError
from flightpower.flight.files import json_object_text

# Evidence for results of versions that gave no verdict.
NO_VERDICT = Evidence(
    kind=EvidenceKind.NO_VERDICT,
    level=Trust.DOUBTFUL,
    text="Its results are of an earlier version, which gave no verdict: analyze the log again.",
)
Json = dict[str, Any]
Read = TypeVar("Read", bound=WithCurves)

OF_SEVERAL = {
    POOLED_FORMAT: "the results of several flights",
    COMPARISON_FORMAT: "a comparison",
    FLEET_FORMAT: "a fleet",
}
FORMATS = (FORMAT, "flightpower-results-2")  # newest first
RESULTS_OF = "results of `analyze`"
# In earlier formats, shared errors of a curve's flights were numbered in the order of the energy balance's parameters.
_NUMBERED = {f"prior {i}": prior_error(name) for i, name in enumerate((*DRAG, *PROPELLER, *LIFT))}
_OF_CURVE = {
    "least_power_speed": "least_power_speed",
    "best_range_speed": "best_range_speed",
    "endurance_s": "endurance_s",
    "range_m": "range_m",
    "interval_parts": "interval_parts",
    "idle_power_W": "idle_power_W",
}
_OF_BALANCE = (
    "residual_W", "flown_s", "airspeed_scale", "thrust_basis", "thrust_efficiency", "shaft_over_electrical",
)  # fmt: skip


def read_results(content: Path | Mapping[str, Any] | Results, where: str = "") -> Results:
    """Return the results of a flight from a file, from its content, or from what `analyze` returned.

    where : named in messages instead of the log. Raises InputError if they are not results of a flight.
    """
    if isinstance(content, Results):
        return content
    if isinstance(content, Path):
        return read_file(content, Results)
    return as_record(content, Results, where or f"results of {content.get('log', 'a flight')}")


def read_flight_or_pool(path: Path) -> Results | PooledResults:
    """Return the results of one flight or of a pool. Raises InputError if they are something else."""
    content, formats = read_json(path), (POOLED_FORMAT, *EARLIER_POOLED_FORMATS)
    if content.get("format") in formats:
        return as_record(content, PooledResults, str(path), formats)
    return as_record(content, Results, str(path))


def read_file(path: Path, record: type[Read], formats: Sequence[str] = FORMATS) -> Read:
    """Return a results.json, or the one in a folder that `analyze` wrote, as a record. Raises InputError if it cannot
    be read, or is something else.
    """
    return as_record(read_json(path), record, str(path), formats)


def read_json(path: Path) -> Json:
    """Return the content of a results.json, or of the one in a folder. Raises InputError if none can be read."""
    path = path / "results.json" if path.is_dir() else path
    try:
        return msgspec.json.decode(json_object_text(path, RESULTS_OF), type=Json)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise InputError(f"{path}: not {RESULTS_OF} ({error}); give the results.json that it wrote") from None


def as_record(content: Mapping[str, Any], record: type[Read], where: str, formats: Sequence[str] = FORMATS) -> Read:
    """Return the content of a results.json as a record. Raises InputError if it is something else.

    formats : accepted formats, newest first
    """
    form = content.get("format", formats[0])
    if form not in formats:
        if form in OF_SEVERAL:
            raise InputError(
                f"{where}: holds {OF_SEVERAL[form]}, and one flight's results are needed here; give the results.json in"
                " that flight's folder"
            )
        raise InputError(f"{where}: format {form!r} is not supported; expected {formats[0]!r}")
    try:
        return msgspec.convert(upgraded(content), record)
    except (msgspec.ValidationError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise InputError(f"{where}: not {RESULTS_OF} ({error}); analyze the log again") from None


def upgraded(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the content in today's form; unchanged if it already has that form."""
    if "curves" in content:
        return content
    old = dict(content)
    electrical, use, pooling = (old.pop(name, None) for name in ("electrical", "use", "pooling"))
    temperature_K, pressure_Pa = (old.pop(name, None) for name in ("air_temperature_K", "air_pressure_Pa"))
    curves = _curves(old, electrical, pooling)
    new = {
        "software_version": "",
        **old,
        "kind": Kind.ELECTRICAL if electrical or Kind.POWER_REQUIRED not in curves else Kind.POWER_REQUIRED,
        "curves": curves,
        "air": _air(old.get("air"), temperature_K, pressure_Pa, electrical),
    }
    if old.get("evidence") is None and "log" in old:
        new |= {"trust": NO_VERDICT.level, "evidence": [NO_VERDICT]}
    if use:
        new["use"] = {name: value for name, value in use.items() if name not in ("battery_energy_Wh", "usable")}
    new["battery"] = _battery(curves.get(Kind.ELECTRICAL, {}), use or electrical or {})
    if electrical:
        new["withheld"] = electrical.get("withheld", [])
        if "residual_W" in electrical:
            new["balance"] = {name: electrical[name] for name in _OF_BALANCE if name in electrical}
    return new


def _curves(old: Json, electrical: Json | None, pooling: Json | None) -> Json:
    """Return the curves, made of fields that are removed from `old`."""
    condition = old.get("test")
    required = {
        "points": old.pop("power_required", []),
        "standard": old.pop("power_required_standard", []),
        "least_power_speed": old.pop("minimum_power_speed", None),
        "best_range_speed": old.pop("best_range_speed", None),
        "interval_parts": old.pop("interval_parts", []),
        # Statistics from another version belong to a different estimate.
        "statistics": pooling if pooling and pooling.get("format") == POOLING_FORMAT else None,
    }
    battery = {"points": old.pop("electrical_power", [])}
    if electrical:
        battery |= {now: electrical[then] for then, now in _OF_CURVE.items() if then in electrical}
        battery["statistics"] = _power_statistics(electrical.get("pooling"))
    shaft = {"points": electrical.get("shaft_power", []) if electrical else []}
    return {
        kind: {"condition": condition, **curve}
        for kind, curve in ((Kind.POWER_REQUIRED, required), (Kind.ELECTRICAL, battery), (Kind.SHAFT, shaft))
        if curve["points"] or curve.get("statistics")
    }


def _power_statistics(statistics: Json | None) -> Json | None:
    if statistics is None:
        return None
    shared = {_NUMBERED.get(name, name): change for name, change in statistics["shared"].items()}
    return {**statistics, "format": POWER_FORMAT, "shared": shared}


def _air(air: Json | None, temperature_K: float | None, pressure_Pa: float | None, electrical: Json | None) -> Json:
    of_flight = {name: electrical.get(name) for name in ("wind_mps", "wind_from_deg")} if electrical else {}
    return {"temperature_K": temperature_K, **of_flight, **(air or {}), "pressure_Pa": pressure_Pa}


def _battery(of_curve: Json, use: Json) -> Json | None:
    """Return the battery if its energy is known. With electrical power, the share used follows from the endurance;
    pools did not record it and used the default of `analyze`."""
    energy_Wh, usable = use.get("battery_energy_Wh"), use.get("usable", ASKED.usable)
    if energy_Wh is None:
        return None
    if of_curve.get("endurance_s"):
        least_W = min(point["power_W"] for point in of_curve["points"])
        usable = of_curve["endurance_s"]["value"] * least_W / (3600 * energy_Wh)
    return {"energy_Wh": energy_Wh, "usable": usable}
