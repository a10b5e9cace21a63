"""Renders a page from the templates: one HTML file that opens without a network."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import msgspec
from jinja2 import Environment, PackageLoader, StrictUndefined

from flightpower.analysis.pages.charts.figure import Figure
from flightpower.analysis.pages.charts.svg import chart, chart_script, chart_style, plain


class HtmlTable(NamedTuple):
    """Text of a table. numbers: all columns but the first are right-aligned"""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: bool = False


class HtmlFigure(NamedTuple):
    """One figure or several side by side, with the ids of their elements. run: the run that they show"""

    parts: list[tuple[str, Figure]]
    run: str = ""


def html_figure(figures: Figure | Sequence[Figure], name: str, run: str = "") -> HtmlFigure:
    """Name figures. name: id of the element; several figures get numbers. run: the run that is shown, if any"""
    if isinstance(figures, Figure):
        return HtmlFigure([(name, figures)], run)
    return HtmlFigure([(f"{name}-{i}", figure) for i, figure in enumerate(figures, start=1)], run)


def render_page(template: str, **context: object) -> str:
    """Fill a template of this package. Text is escaped. Raises UndefinedError if the template uses other names."""
    common = {"chart": chart, "chart_style": chart_style(), "chart_script": chart_script()}
    return _environment().get_template(template).render(common | context)


def to_json(value: object, **_: object) -> str:
    """Return figures as JSON: NaN becomes null, where a line is interrupted."""
    return msgspec.json.encode(value, enc_hook=plain).decode()


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("flightpower.analysis.pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # In the text that this returns, jinja2 escapes <, >, & and '.
    environment.policies["json.dumps_function"] = to_json
    environment.policies["json.dumps_kwargs"] = {}
    return environment
