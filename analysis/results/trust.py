"""Reasons not to trust a result: those for which `analyze` ends with exit code 1 (docs/results.md)."""

from analysis.schema import PowerPoint, Results

NOT_TO_TRUST = "not_to_trust"  # name under which the results of a flight in a pool have its reasons


def reasons_not_to_trust(results: Results) -> list[str]:
    """Each in one sentence; empty for a result that can be used within its interval."""
    reasons = []
    if results.status and not results.status.usable:
        reasons.append(f"The estimation did not converge: {results.verdict}.")
    elif results.path is not None and not results.path.converged:
        reasons.append("The trajectory did not converge.")
    curve = results.power_required or results.electrical_power
    if any(point.power_lo_W <= 0 for point in curve):
        reasons.append(f"The 95 % interval reaches zero at {_least(curve).speed_mps:.1f} m/s.")
    if results.drag_polar is not None and results.drag_polar.A2 <= 0:
        reasons.append("Drag does not increase with lift: the range of lift coefficients flown is too narrow.")
    if results.cross_check_differs:
        reasons.append(
            f"The cross-check by {results.cross_check_by} differs from the curve by more than their intervals allow."
        )
    return reasons


def _least(curve: list[PowerPoint]) -> PowerPoint:
    return min(curve, key=lambda point: point.power_lo_W)
