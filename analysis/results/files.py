"""`results.json` and `power_required.csv` as text (docs/use/results.md)."""

import csv
import io

import msgspec

from flightpower.analysis.records.flight import Results


def to_json(results: Results) -> bytes:
    return msgspec.json.format(msgspec.json.encode(results), indent=1)


def to_csv(results: Results) -> str:
    """The curve that the report leads with, as flown and at the standard condition; one row per point."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    fields = ("speed_mps", "power_W", "power_lo_W", "power_hi_W")
    writer.writerow(["condition", "weight_N", "air_density_kgpm3", *fields, "extrapolated"])
    for name, condition, curve in (
        ("test", results.test, results.main.points),
        ("standard", results.standard, results.main.standard),
    ):
        for point in curve:
            assert condition is not None  # a curve has one
            numbers = (condition.weight_N, condition.air_density_kgpm3, *(getattr(point, field) for field in fields))
            flag = "true" if point.extrapolated else "false"
            writer.writerow([name, *(f"{number:.6g}" for number in numbers), flag])
    return out.getvalue()
