"""`results.json` and `power_required.csv` as text (docs/use/results.md)."""

import csv
import io

import msgspec

from analysis.records.flight import Results


def to_json(results: Results) -> bytes:
    return msgspec.json.format(msgspec.json.encode(results), indent=1)


def to_csv(results: Results) -> str:
    """Both curves of power required, or that of electrical power where the report leads with it; one row per point."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    fields = ("speed_mps", "power_W", "power_lo_W", "power_hi_W")
    writer.writerow(["condition", "weight_N", "air_density_kgpm3", *fields, "extrapolated"])
    for name, condition, curve in (
        ("test", results.test, results.electrical_power if results.electrical else results.power_required),
        ("standard", results.standard, results.power_required_standard),
    ):
        for point in curve:
            numbers = (condition.weight_N, condition.air_density_kgpm3, *(getattr(point, field) for field in fields))
            flag = "true" if point.extrapolated else "false"
            writer.writerow([name, *(f"{number:.6g}" for number in numbers), flag])
    return out.getvalue()
