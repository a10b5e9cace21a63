"""The flying card: one A4 page in black on white, large enough to read in sunlight."""

from html import escape

from analysis.planning import texts
from analysis.planning.search import FlightPlan

STYLE = """
@page { size: A4; margin: 9mm; }
* { box-sizing: border-box; }
body { color: #000; background: #fff; font: 600 12.5pt/1.22 system-ui, sans-serif; margin: 0 auto; max-width: 192mm; }
h1 { font-size: 19pt; margin: 0 0 1mm; }
p { margin: 0 0 1.5mm; }
table { border-collapse: collapse; width: 100%; margin: 0 0 2mm; }
td, th { border: 1.6pt solid #000; padding: 0.8mm 1.6mm; text-align: left; vertical-align: top; }
td.n { font-size: 17pt; font-weight: 800; white-space: nowrap; text-align: center; }
td.t { font-size: 15pt; font-weight: 800; white-space: nowrap; text-align: right; }
.title { font-size: 13.5pt; font-weight: 800; }
.steps { font-weight: 500; }
.stall { border: 2.5pt solid #000; padding: 1.2mm 2mm; font-weight: 700; }
.widths td, .widths th { text-align: center; }
@media screen { body { padding: 3mm; } }
ul { margin: 0; padding-left: 5mm; font-size: 10.5pt; font-weight: 500; }
""".strip()


def card(plan: FlightPlan, name: str) -> str:
    """The HTML page, without anything from a network."""
    request, space = plan.request, plan.request.space
    minutes, seconds = divmod(round(plan.seconds), 60)
    head = (
        f"For {plan.question.title}. Wind and turbulence of {request.wind_kt:g} kt. {space.height_m:.0f} m high, legs"
        f" of at most {space.leg_m:.0f} m, and {texts.side_m(plan):.0f} m to their side for the turns. Turn left as"
        " often as right. Runs: wings level, height within a few metres."
    )
    lines = "".join(
        f'<tr><td class="n">{escape(row.times)}</td><td><span class="title">{escape(row.title)}</span><br>'
        f'<span class="steps">{escape(row.steps)}</span></td><td class="t">{_clock(row.seconds)}</td></tr>'
        for row in texts.rows(plan)
    )
    widths = texts.expected_interval(plan)
    speeds = "".join(f"<th>{escape(speed)}</th>" for speed, _ in widths)
    halves = "".join(f"<td>{escape(half)}</td>" for _, half in widths)
    lost = "".join(f"<li>{escape(line)}</li>" for line in texts.losses(plan))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(name)}: flying card</title><style>{STYLE}</style></head><body>\n"
        f"<h1>{escape(name)}: {minutes} min {seconds:02d} s</h1>\n"
        f'<p>{escape(head)}</p>\n<p class="stall">{escape(texts.margin(plan))}</p>\n<table>{lines}</table>\n'
        f'<table class="widths"><tr><th>speed</th>{speeds}</tr><tr><th>power, 95 %</th>{halves}</tr></table>\n'
        f"<p>At the worst speed:</p>\n<ul>{lost}</ul>\n</body></html>\n"
    )


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"
