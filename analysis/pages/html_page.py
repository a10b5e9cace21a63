"""Rendering of a page from the templates: one HTML file that opens without a network.

Figures are drawn by Plotly's basic bundle (vendor/, MIT license), a quarter of the whole library.
"""

from collections.abc import Sequence
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

import msgspec
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from analysis.pages.charts.style import ON_DARK, Figure
from analysis.pages.charts.svg import color_variable, svg

PLOTLY = "plotly-basic.min.js"
DRAWN_AT_ONCE = ("power", "difference")  # the first figure of a page


class HtmlTable(NamedTuple):
    """Text of a table; numbers: right-aligned but for the first column."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    numbers: bool = False


class HtmlFigure(NamedTuple):
    """A figure or several side by side: ids of the elements and what is drawn in them.

    run: the one that they show     still: the figure as SVG, until a script draws it
    """

    parts: list[tuple[str, Figure]]
    run: str = ""
    still: str = ""


def html_figure(drawn: Figure | Sequence[Figure], name: str, run: str = "") -> HtmlFigure:
    """name: id of the element; of several figures, with their number. run: the one that is shown, if it is one."""
    if isinstance(drawn, Figure) and name in DRAWN_AT_ONCE:
        return HtmlFigure([(name, drawn)], run, svg(drawn))
    if isinstance(drawn, Figure):
        return HtmlFigure([(name, drawn)], run)
    return HtmlFigure([(f"{name}-{i}", figure) for i, figure in enumerate(drawn, start=1)], run)


def render_page(template: str, **context: object) -> str:
    """A template of this package, filled. Text is escaped; raises UndefinedError when the template names more."""
    plotly_js = resources.files("analysis.pages").joinpath("vendor", PLOTLY).read_text("utf-8")
    colors = {color_variable(light): (light, dark) for light, dark in ON_DARK.items()}
    return _environment().get_template(template).render(plotly_js=plotly_js, on_dark=ON_DARK, colors=colors, **context)


def to_json(value: object, **_: object) -> str:
    """JSON of figures: NaN becomes null, where a line is interrupted."""
    return msgspec.json.encode(value, enc_hook=_plain).decode()


def _plain(value: Any) -> Any:
    """Arrays and numbers of NumPy as Python's."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise NotImplementedError(f"{type(value).__name__} in a figure")


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("analysis.pages"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    # jinja2 escapes <, >, & and ' of what this returns.
    environment.policies["json.dumps_function"] = to_json
    environment.policies["json.dumps_kwargs"] = {}
    return environment
