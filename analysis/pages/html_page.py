"""Rendering of a page from the templates: one HTML file that opens without a network."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import msgspec
from jinja2 import Environment, PackageLoader, StrictUndefined

from flightpower.analysis.pages.charts.figure import Figure
from flightpower.analysis.pages.charts.svg import chart, chart_script, chart_style, plain


class HtmlTable(NamedTuple):
    """Text of a table; numbers: right-aligned except for the first column."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: bool = False


class HtmlFigure(NamedTuple):
    """A figure or several side by side, by the ids of their elements. run: the one that they show"""

    parts: list[tuple[str, Figure]]
    run: str = ""


def html_figure(figures: Figure | Sequence[Figure], name: str, run: str = "") -> HtmlFigure:
    """name: id of the element; of several figures, with their number. run: the one that is shown, if it is one."""
    if isinstance(figures, Figure):
        return HtmlFigure([(name, figures)], run)
    return HtmlFigure([(f"{name}-{i}", figure) for i, figure in enumerate(figures, start=1)], run)


def render_page(template: str, **context: object) -> str:
    """A template of this package, filled. Text is escaped; raises UndefinedError when the template names more."""
    common = {"chart": chart, "chart_style": chart_style(), "chart_script": chart_script()}
    return _environment().get_template(template).render(common | context)


def to_json(value: object, **_: object) -> str:
    """JSON of figures: NaN becomes null, where a line is interrupted."""
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
    # jinja2 escapes <, >, & and ' of what this returns.
    environment.policies["json.dumps_function"] = to_json
    environment.policies["json.dumps_kwargs"] = {}
    return environment
