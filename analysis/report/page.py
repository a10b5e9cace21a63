"""The report page: its sections and figures put into the template `report.html`."""

from collections.abc import Mapping, Sequence

from analysis.report.figures.figure import Figure
from analysis.report.html_page import html_figure, render_page
from analysis.report.sections.autopilot import autopilot_section
from analysis.report.sections.certainty import certainty_section
from analysis.report.sections.curve import curve_section
from analysis.report.sections.flight import flight_section
from analysis.report.sections.methods import methods_section
from analysis.report.sections.performance import performance_section
from analysis.report.sections.provenance import provenance_section
from analysis.report.sections.sensors import sensors_section
from analysis.report.sections.summary import summary_section
from analysis.report.sections.verdict import verdict_section
from analysis.results.schema import Results


def render(
    results: Results,
    figures: Mapping[str, Figure | Sequence[Figure]],
    run_fits: Sequence[Figure | Sequence[Figure]],
    *,
    replaced: str = "",
) -> str:
    """The page as one HTML file.

    figures: by name (`report_figures.figures_by_name`); run_fits: one for each run. replaced: what the report replaces.
    """
    return render_page(
        "report.html",
        summary=summary_section(results),
        verdict=verdict_section(results),
        certainty=certainty_section(results),
        provenance=provenance_section(results),
        replaced=replaced,
        performance=performance_section(results),
        methods=methods_section(results),
        curve=curve_section(results),
        flight=flight_section(results),
        sensors=sensors_section(results),
        autopilot=autopilot_section(results),
        figures={name: html_figure(figure, name) for name, figure in figures.items()},
        run_fits=[html_figure(figure, f"fit-{i}") for i, figure in enumerate(run_fits)],
    )
