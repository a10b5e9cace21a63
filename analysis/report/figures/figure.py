"""A figure as Plotly's JavaScript takes it: traces and layout. Plotly's Python classes check every value, which took
longer than everything else that the page needs."""

from typing import Any

Json = dict[str, Any]


class Figure:
    """Panels above one another with one x axis. Properties are those of Plotly's traces and layouts.

    data : traces, in the order of drawing      layout : of the figure
    """

    def __init__(self, panels: int = 1, gap: float = 0.05):
        """gap: between two panels, as a share of the height of all."""
        self.data: list[Json] = []
        self.layout: Json = {"xaxis": {"anchor": _axis("y", panels)}}
        self.panels = panels
        height = (1 - gap * (panels - 1)) / panels
        for panel in range(1, panels + 1):
            top = 1 - (panel - 1) * (height + gap)
            self.layout[_axis("yaxis", panel)] = {"domain": [max(0.0, top - height), top], "anchor": "x"}

    def add_scatter(self, *, panel: int = 1, **trace: Any) -> None:
        """A trace of lines or markers. panel: counted from 1, at the top."""
        self.data.append({"type": "scatter", "xaxis": "x", "yaxis": _axis("y", panel), **trace})

    def add_bars(self, *, panel: int = 1, **trace: Any) -> None:
        """A trace of bars. panel as in `add_scatter`."""
        self.data.append({"type": "bar", "xaxis": "x", "yaxis": _axis("y", panel), **trace})

    def add_zero_line(self, line: Json, *, panel: int = 1) -> None:
        """A horizontal line at zero across a panel."""
        shape = {"type": "line", "xref": "x domain", "x0": 0, "x1": 1, "yref": _axis("y", panel), "y0": 0, "y1": 0}
        self.layout.setdefault("shapes", []).append(shape | {"line": line})

    def update_xaxis(self, **properties: Any) -> None:
        self.layout["xaxis"].update(_titled(properties))

    def update_yaxis(self, *, panel: int = 1, **properties: Any) -> None:
        self.layout[_axis("yaxis", panel)].update(_titled(properties))

    def update_yaxes(self, **properties: Any) -> None:
        """The y axes of all panels."""
        for panel in range(1, self.panels + 1):
            self.update_yaxis(panel=panel, **properties)

    def update_layout(self, **properties: Any) -> None:
        """Properties inside a margin, font or legend are added to those that it has."""
        for name, value in properties.items():
            before = self.layout.get(name)
            self.layout[name] = before | value if isinstance(before, dict) and isinstance(value, dict) else value


def _titled(properties: Json) -> Json:
    """The same with a title that is text as Plotly wants it."""
    title = properties.get("title")
    return properties | {"title": {"text": title}} if isinstance(title, str) else properties


def _axis(name: str, panel: int) -> str:
    """ "y", "y2", "y3": Plotly numbers axes from the second on."""
    return name if panel == 1 else f"{name}{panel}"
