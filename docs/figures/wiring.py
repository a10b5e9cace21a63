"""Draws docs/figures/wiring.svg and plumbing.svg of docs/use/hardware.md: `python docs/figures/wiring.py`.

Both are narrow and their letters large, to be read on a phone and on paper.
"""

from pathlib import Path

WIDTH = 480
COLOR = {"3.3 V": "#d68910", "5 V": "#c0392b", "GND": "#222222", "SDA": "#1f618d", "SCL": "#1e8449", "data": "#6c3483"}
HOSE = "#5d6d7e"

BOARDS = (
    ("MPU-9250, AK8963", "0x68, 0x0C", "screwed to the airframe"),
    ("MS5611, no hose", "0x77: pin CSB low", "in the fuselage, shaded"),
    ("static: one barb", "MS5805", "0x76"),
    ("alpha: two barbs", "MS4515DO-DS3AJ002DP", "0x36"),
    ("beta: two barbs", "MS4515DO-DS3AK002DP", "0x46"),
    ("airspeed: two barbs", "SSCDRRN005ND2A3", "0x28"),
    ("INA226, if needed", "0x40: A0, A1 to GND", "its shunt: see below"),
    ("ADS1115, if needed", "0x48: ADDR to GND", "A0 to A3: at most 3.3 V"),
)
HIGH, LOW = "P1 +", "P2 −"
# From each port of the probe to a barb of a transducer; the sign is that of the pressure at the barb.
HOSES = (
    ("lower", "alpha", HIGH),
    ("upper", "alpha", LOW),
    ("right", "beta", HIGH),
    ("left", "beta", LOW),
    ("center", "airspeed", HIGH),
    ("static ring", "airspeed", LOW),
)
# Pins of the pulse counter, and of the RPM sensor below it.
COUNTER = (("D8", "output", "data"), ("GND", "ground", "GND"), ("5V", "supply", "5 V"))
RECEIVER = (("3.3 V", 17, "3.3 V"), ("GND", 14, "GND"), ("TX", 10, "data"), ("RX", 8, "data"))


def box(x: float, y: float, w: float, h: float, fill: str = "#f7f9fb") -> str:
    return f'<rect x="{x}" y="{y}" width="{w}" height="{h}" rx="5" fill="{fill}" stroke="#444"/>'


def text(
    x: float, y: float, words: str, *, size: float = 13, fill: str = "#222", anchor: str = "start", bold: int = 400
) -> str:
    how = f'font-size="{size}" fill="{fill}" text-anchor="{anchor}" font-weight="{bold}"'
    return f'<text x="{x}" y="{y}" {how}>{words}</text>'


def lines(x: float, y: float, title: str, *more: str) -> list[str]:
    """A title, and lines under it."""
    return [text(x, y, title, bold=700), *(text(x, y + 17 * (i + 1), line) for i, line in enumerate(more))]


def path(kind: str, *points: tuple[float, float], width: float = 2, ends: bool = True) -> str:
    color = COLOR.get(kind, HOSE)
    dots = "".join(f'<circle cx="{x}" cy="{y}" r="3.5" fill="{color}"/>' for x, y in (points[0], points[-1]) if ends)
    points_text = " ".join(f"{x},{y}" for x, y in points)
    return f'<polyline points="{points_text}" fill="none" stroke="{color}" stroke-width="{width}"/>{dots}'


def pin(x: float, y: float, number: str, name: str, kind: str) -> str:
    """A pin at the right edge of the computer, its label inside."""
    return text(x - 8, y + 4.5, f"{number}: {name}" if number else name, anchor="end", fill=COLOR[kind])


def page(height: float, parts: list[str], title: str) -> str:
    size, style = f'width="{WIDTH}" height="{height}"', 'font-family="sans-serif" role="img"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {WIDTH} {height}" {style}>'
    return "\n".join([head, f"<title>{title}</title>", f'<rect {size} fill="white"/>', *parts, "</svg>", ""])


def barb_at(y: float) -> str:
    """The barb of a transducer's box."""
    return f'<rect x="286" y="{y - 5}" width="14" height="10" fill="#bbb" stroke="#444"/>'


def wiring() -> str:
    """Each wire ends at two pins; where wires cross without a dot they are not joined."""
    edge, left, top, step = 120, 232, 50, 88
    kinds = ("3.3 V", "SDA", "SCL", "GND")
    rails = {"3.3 V": 150, "SDA": 170, "SCL": 190, "GND": 210}
    pins = {"3.3 V": ("1", 82), "SDA": ("3", 116), "SCL": ("5", 134), "GND": ("9", 219)}
    parts = [text(10, 20, "I2C bus 1 of the example tray: /dev/i2c-1, 400 kHz", bold=700)]
    parts.append(text(10, 38, "Wires that cross without a dot are not joined."))
    parts.append(box(10, top, edge - 10, (len(BOARDS) + 1) * step + 348, "#eaf4ea"))
    parts.append(text(18, top + 18, "Raspberry Pi", bold=700))
    for i, board in enumerate(BOARDS):
        y = top + i * step
        parts += [box(left, y, WIDTH - left - 8, step - 12), *lines(left + 54, y + 24, *board)]
        for k, kind in enumerate(kinds):
            wire_y = y + 13 + 17 * k
            parts += [
                path(kind, (rails[kind], wire_y), (left, wire_y)),
                text(left + 8, wire_y + 4.5, kind, size=12, fill=COLOR[kind]),
            ]
    last = top + (len(BOARDS) - 1) * step
    for k, kind in enumerate(kinds):
        number, y = pins[kind]
        parts += [pin(edge, y, number, kind, kind), path(kind, (edge, y), (rails[kind], y))]
        parts.append(path(kind, (rails[kind], top + 13 + 17 * k), (rails[kind], last + 13 + 17 * k), ends=False))
    y = top + len(BOARDS) * step
    parts += [
        box(left, y, WIDTH - left - 8, step),
        *lines(left + 54, y + 24, "GPS, u-blox", "pin VCC: 3.3 V (a board", "with a regulator: 5 V)"),
    ]
    for k, (name, number, kind) in enumerate(RECEIVER):
        wire_y = y + 16 + 18 * k
        pi_name = {"TX": "RXD", "RX": "TXD"}.get(name, name)
        parts += [pin(edge, wire_y, str(number), pi_name, kind), path(kind, (edge, wire_y), (left, wire_y))]
        parts.append(text(left + 8, wire_y + 4.5, {"3.3 V": "VCC"}.get(name, name), size=12, fill=COLOR[kind]))
    y += step + 12
    parts += [
        box(left, y, WIDTH - left - 8, 76),
        *lines(left + 12, y + 20, "Pulse counter", "Arduino Nano, ATmega328P"),
    ]
    parts += [pin(edge, y + 32, "", "USB", "data"), path("data", (edge, y + 32), (left, y + 32))]
    sensor = y + 104
    parts += [
        box(left, sensor, WIDTH - left - 8, 76),
        *lines(left + 12, sensor + 46, "RPM sensor", "at one phase of the motor"),
    ]
    for k, (above, below, kind) in enumerate(COUNTER):
        wire_x = left + 36 + 76 * k
        parts += [path(kind, (wire_x, y + 76), (wire_x, sensor))]
        parts.append(text(wire_x, y + 68, above, size=12, anchor="middle", fill=COLOR[kind]))
        parts.append(text(wire_x, sensor + 18, below, size=12, anchor="middle", fill=COLOR[kind]))
    y = sensor + 88
    parts += [
        box(left, y, WIDTH - left - 8, 64),
        *lines(left + 12, y + 20, "Autopilot, if any", "telemetry port, 57600 baud,", "by a USB serial adapter"),
    ]
    parts += [pin(edge, y + 32, "", "USB", "data"), path("data", (edge, y + 32), (left, y + 32))]
    y += 76
    parts += [
        box(left, y, WIDTH - left - 8, 64),
        *lines(left + 54, y + 20, "Supply: 5 V, 3 A", "converter of its own", "on the flight battery"),
    ]
    for wire_y, number, kind in ((y + 20, "2, 4", "5 V"), (y + 44, "6", "GND")):
        parts += [pin(edge, wire_y, number, kind, kind), path(kind, (edge, wire_y), (left, wire_y))]
        parts.append(text(left + 8, wire_y + 4.5, kind, size=12, fill=COLOR[kind]))
    parts += shunt(y + 92)
    return page(y + 232, parts, "Wiring: which pin of the Raspberry Pi goes where")


def shunt(y: float) -> list[str]:
    """The power monitor's shunt in the battery's positive line. Current out of the battery is positive at IN+."""
    parts = [text(10, y, "INA226: the shunt in the battery's positive line", bold=700)]
    plus, minus, monitor = y + 38, y + 112, y + 62
    parts += [box(10, y + 16, 92, 112), text(56, y + 76, "battery", anchor="middle", bold=700)]
    parts += [box(376, y + 16, 96, 112), *lines(384, y + 70, "controller", "and motor")]
    parts += [path("5 V", (102, plus), (200, plus), width=4), path("GND", (102, minus), (376, minus), width=4)]
    parts += [path("5 V", (288, plus), (376, plus), width=4)]
    parts += [text(94, plus + 4.5, "+", anchor="end", bold=700), text(94, minus + 4.5, "−", anchor="end", bold=700)]
    parts += [box(200, plus - 11, 88, 22, "#fdf6e3"), text(244, plus + 4.5, "shunt", anchor="middle")]
    for pin_x, name in ((150, "VBUS"), (186, "IN+"), (302, "IN−")):
        parts += [
            path("data", (pin_x, plus), (pin_x, monitor)),
            text(pin_x, monitor + 18, name, size=12, anchor="middle"),
        ]
    return [*parts, text(112, minus - 10, "also the Pi's ground, by its converter", size=12)]


def plumbing() -> str:
    """Each hose is a horizontal line from a port of the probe to a barb; the static line has a T."""
    parts = [text(10, 20, "Hoses, all of equal length and diameter", bold=700)]
    x, y, radius = 70, 92, 46
    parts += [
        text(10, 40, "The tip, seen from behind:"),
        f'<circle cx="{x}" cy="{y}" r="{radius}" fill="#eef1f4" stroke="#444"/>',
    ]
    holes = {"upper": (0, -28), "lower": (0, 28), "left": (-28, 0), "right": (28, 0), "center": (0, 0)}
    parts += [f'<circle cx="{x + dx}" cy="{y + dy}" r="5" fill="#222"/>' for dx, dy in holes.values()]
    parts += [
        text(130, 76, "five ports, and the static ring", fill="#222"),
        text(130, 96, "behind it. Left and right are those"),
    ]
    parts += [text(130, 116, "of the aircraft, flying away from you.")]
    parts += [box(10, 152, 108, 300, "#eef1f4"), text(18, 444, "probe", bold=700)]
    transducers = {
        "alpha": ("MS4515DO", "0x36", 152),
        "beta": ("MS4515DO", "0x46", 238),
        "airspeed": ("SSCDRRN", "0x28", 324),
    }
    for name, (part, address, top) in transducers.items():
        parts += [box(300, top, 172, 76, "#fdf6e3"), *lines(362, top + 24, name, part, address)]
    for port, name, barb in HOSES:
        port_y = transducers[name][2] + (24 if barb == HIGH else 52)
        parts += [
            text(110, port_y + 4.5, port, anchor="end"),
            path("hose", (118, port_y), (286, port_y), width=5, ends=False),
        ]
        parts += [barb_at(port_y), text(308, port_y + 4.5, barb, bold=700)]
    tee = 200
    parts.append(path("hose", (tee, 376), (tee, 432), (286, 432), width=5, ends=False))
    parts += [f'<circle cx="{tee}" cy="376" r="7" fill="{HOSE}"/>', text(tee + 12, 398, "T", bold=700)]
    parts += [box(300, 410, 172, 56, "#fdf6e3"), barb_at(432), *lines(362, 432, "static", "MS5805, 0x76")]
    parts += [
        text(10, 496, "P1: the barb at which more pressure counts positive, marked so in"),
        text(10, 514, "the drawing of the part's data sheet. Blow across, never into."),
    ]
    parts += [text(10, 536, "MS5611 has no hose: it measures inside the fuselage.")]
    return page(550, parts, "Plumbing: which port of the probe goes to which barb")


if __name__ == "__main__":
    for name, drawing in (("wiring", wiring()), ("plumbing", plumbing())):
        Path(__file__).with_name(f"{name}.svg").write_text(drawing, encoding="utf-8")
