"""`results.json` and `power_required.csv` as text (docs/use/results.md)."""

import csv
import io

import msgspec

from flightpower.analysis.records.flight import ConditionResult, Results, WithCurves


def to_json(results: Results) -> bytes:
    return msgspec.json.format(msgspec.json.encode(results), indent=1)


def to_csv(results: WithCurves, standard: ConditionResult | None = None) -> str:
    """Return the report's main curve, as flown and at the standard condition if given; one row per point."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    fields = ("speed_mps", "power_W", "power_lo_W", "power_hi_W")
    writer.writerow(["condition", "weight_N", "air_density_kgpm3", *fields, "extrapolated"])
    curves = [("test", results.test, results.main.points)]
    if standard is not None:
        curves.append(("standard", standard, results.main.standard))
    for name, condition, curve in curves:
        for point in curve:
            numbers = (condition.weight_N, condition.air_density_kgpm3, *(getattr(point, field) for field in fields))
            flag = "true" if point.extrapolated else "false"
            writer.writerow([name, *(f"{number:.6g}" for number in numbers), flag])
    return out.getvalue()
