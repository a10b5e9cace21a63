"""The methods that the report shows, in order."""

from analysis.maneuvers.kinds import LEVEL_RUNS
from analysis.results.schema import MethodResult, Results


def listed_methods(results: Results) -> list[MethodResult]:
    """All methods; the first is the one whose curve is `results.power_required`."""
    if not any(run.kind in LEVEL_RUNS for run in results.runs):
        polar = results.drag_polar  # without level runs the curve is that of one of the other methods
        main = [polar.A0, polar.A1, polar.A2] if polar else []
        return sorted(results.methods, key=lambda m: m.drag_polar != main)
    from_level_runs = (
        MethodResult(
            name="dynamic", title="dynamic, two steps", equations="(3.45), trajectory and forces",
            power_required=results.power_required,
        ),
        MethodResult(
            name="cross-check", title=f"{results.cross_check_by}, runs alone", equations="(3.24-3.45)",
            power_required=results.cross_check,
        ),
    )  # fmt: skip
    others = {method.name for method in results.methods}
    return [*(method for method in from_level_runs if method.name not in others), *results.methods]


def capitalized_title(method: MethodResult) -> str:
    return method.title[:1].upper() + method.title[1:]
