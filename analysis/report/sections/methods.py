"""Comparison of the methods: the table of all of them, and the pairs that disagree."""

from collections.abc import Sequence
from typing import NamedTuple

from analysis.report.html_page import HtmlTable
from analysis.report.method_list import listed_methods
from analysis.report.parameter_meaning import short_name
from analysis.results.schema import PowerPoint, Results
from analysis.results.schema_likelihood import PitchRateResult


class MethodsSection(NamedTuple):
    table: HtmlTable
    disagreements: list[str]
    agree: bool  # methods were compared and no pair disagrees
    cross_check_differs: bool
    points: bool  # a method has points of its own
    pitch_rate: str  # significance of C_Lq; empty where it was not estimated
    says: str  # whether they agree, in a few words


def methods_section(results: Results) -> MethodsSection:
    rows = [
        (
            method.title,
            method.equations,
            ", ".join(short_name(name) for name in method.taken_as_measured),
            *_power_at_ends(method.power_required),
            "; ".join(method.notes),
        )
        for method in listed_methods(results)
    ]
    return MethodsSection(
        HtmlTable(("method", "equations", "taken as measured", "slowest, W", "fastest, W", "notes"), rows),
        [disagreement.text for disagreement in results.disagreements],
        bool(results.methods) and not results.disagreements,
        results.cross_check_differs,
        any(method.points for method in results.methods),
        _pitch_rate(results.pitch_rate),
        f"{len(results.disagreements)} pairs disagree" if results.disagreements else "none disagrees",
    )


def _pitch_rate(found: PitchRateResult | None) -> str:
    if found is None:
        return ""
    ratios = ", ".join(f"{ratio:.2g} in the {run}" for run, ratio in found.signal_to_noise.items())
    differs = "differs significantly" if found.significant else "does not differ significantly"
    return (
        f"Pitch rate over its noise ({found.noise_radps:.4f} rad/s), as variances (4.7): {ratios}. Lift due to pitch"
        f" rate, by maximum likelihood: C_Lq = {found.CLq:.1f} ± {found.standard_error:.1f} (standard error),"
        f" t = {found.t:.1f} (4.4); it {differs} from zero, for which {found.critical_t:.2f} would be needed."
    )


def _power_at_ends(curve: Sequence[PowerPoint]) -> tuple[str, str]:
    """Power with half its 95 % interval at the slowest and at the fastest speed of a curve."""
    if not curve:
        return "no curve", ""
    slow, fast = (
        f"{p.power_W:.0f} ± {(p.power_hi_W - p.power_lo_W) / 2:.0f} at {p.speed_mps:.1f} m/s"
        for p in (curve[0], curve[-1])
    )
    return slow, fast
