"""Rendering of a page from the templates: one HTML file that opens without a network."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import plotly.graph_objects as go
import plotly.io.json
from jinja2 import Environment, PackageLoader, StrictUndefined
from plotly.offline import get_plotlyjs


class HtmlTable(NamedTuple):
    """Text of a table; numbers: right-aligned but for the first column."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: bool = False


class HtmlFigure(NamedTuple):
    """A Plotly figure: the id of its element, its height, and its data and layout for `Plotly.newPlot`."""

    name: str
    height_px: int
    data: object
    layout: object


def html_figure(figure: go.Figure, name: str) -> HtmlFigure:
    content = figure.to_dict()
    return HtmlFigure(name, int(figure.layout.height), content["data"], content["layout"])


def render_page(template: str, **context: object) -> str:
    """A template of this package, filled. Text is escaped; raises UndefinedError when the template names more."""
    return _environment().get_template(template).render(plotly_js=get_plotlyjs(), **context)


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("analysis.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # Plotly's own encoder knows arrays; jinja2 escapes <, >, & and ' of what it returns.
    environment.policies["json.dumps_function"] = plotly.io.json.to_json_plotly
    environment.policies["json.dumps_kwargs"] = {}
    return environment
