"""Draws docs/figures/wiring.svg, the wiring diagram of docs/use/hardware.md: `python docs/figures/wiring.py`."""

from pathlib import Path

WIDTH, HEIGHT = 1000, 800
COLOR = {"5V": "#c0392b", "3.3V": "#d68910", "GND": "#222222", "SDA": "#1f618d", "SCL": "#1e8449", "UART": "#6c3483"}

PROBE = ["upper, lower: alpha", "left, right: beta", "center: total", "static ring", "tubes of equal length"]


def box(x: float, y: float, w: float, h: float, title: str, lines: list[str], fill: str = "#f7f9fb") -> str:
    out = [f'<rect x="{x}" y="{y}" width="{w}" height="{h}" rx="6" fill="{fill}" stroke="#444"/>']
    out.append(f'<text x="{x + 10}" y="{y + 20}" font-weight="bold">{title}</text>')
    out += [f'<text x="{x + 10}" y="{y + 38 + 16 * i}" font-size="12">{line}</text>' for i, line in enumerate(lines)]
    return "\n".join(out)


def wire(kind: str, *points: tuple[float, float]) -> str:
    path = " ".join(f"{x},{y}" for x, y in points)
    ends = "".join(f'<circle cx="{x}" cy="{y}" r="3" fill="{COLOR[kind]}"/>' for x, y in (points[0], points[-1]))
    return f'<polyline points="{path}" fill="none" stroke="{COLOR[kind]}" stroke-width="2"/>{ends}'


def label(x: float, y: float, text: str, kind: str | None = None, anchor: str = "start") -> str:
    fill = COLOR[kind] if kind else "#222"
    return f'<text x="{x}" y="{y}" font-size="12" fill="{fill}" text-anchor="{anchor}">{text}</text>'


def drawing() -> str:
    parts = [
        box(30, 60, 190, 560, "Raspberry Pi", ["header pin"], "#eaf4ea"),
        box(420, 60, 290, 78, "MPU-9250 (0x68, AK8963 0x0C)", ["3.3 V; screwed to the airframe", "near its center"]),
        box(420, 150, 290, 60, "MS5611 (0x77)", ["3.3 V; in the fuselage, shaded"]),
        box(420, 222, 290, 60, "MS5805 (0x76)", ["3.3 V; hose to the static line"]),
        box(420, 300, 290, 60, "MS4515DO-DS3AJ002DP (0x36)", ["3.3 V; alpha ports"], "#fdf6e3"),
        box(420, 372, 290, 60, "MS4515DO-DS3AK002DP (0x46)", ["3.3 V; beta ports"], "#fdf6e3"),
        box(420, 444, 290, 60, "SSCDRRN005ND2A3 (0x28)", ["3.3 V; total and static"], "#fdf6e3"),
        box(420, 524, 290, 60, "u-blox M8", ["3.3 or 5 V; antenna with a clear sky"]),
        box(420, 604, 290, 60, "ATmega328P (Arduino Nano)", ["5 V by USB; firmware/esc_counter"]),
        box(420, 684, 290, 60, "Autopilot (MAVLink)", ["telemetry port, USB adapter, 57600 baud"]),
        box(760, 604, 210, 60, "RPM sensor", ["on one phase of the motor:", "a pulse an electrical period"]),
        box(760, 300, 210, 204, "Five-port probe", PROBE),
        box(30, 660, 190, 84, "Supply", ["5 V, 3 A, from a converter", "of its own, not from the", "speed controller"]),
    ]  # fmt: skip
    pins = {
        "1: 3.3 V": ("3.3V", 110), "3: SDA": ("SDA", 180), "5: SCL": ("SCL", 250), "6: GND": ("GND", 320),
        "8: TXD": ("UART", 540), "10: RXD": ("UART", 570),
    }  # fmt: skip
    for name, (kind, y) in pins.items():
        parts.append(label(210, y + 4, name, kind, "end"))
        parts.append(f'<circle cx="220" cy="{y}" r="4" fill="{COLOR[kind]}"/>')
    parts += [label(210, 605, "USB", None, "end"), label(125, 652, "2, 4: 5 V; 6: GND", "5V", "middle")]
    rails = {"3.3V": (280, 110), "SDA": (305, 180), "SCL": (330, 250), "GND": (355, 320)}
    drops = {"3.3V": 12, "SDA": 24, "SCL": 36, "GND": 48}
    for kind, (x, y) in rails.items():
        parts.append(wire(kind, (220, y), (x, y)))
        parts.append(wire(kind, (x, 60 + drops[kind]), (x, 444 + drops[kind])))
        for top in (60, 150, 222, 300, 372, 444):
            parts.append(wire(kind, (x, top + drops[kind]), (420, top + drops[kind])))
    parts.append(wire("UART", (220, 540), (390, 540), (390, 545), (420, 545)))
    parts.append(wire("UART", (220, 570), (420, 570)))
    parts.append(wire("GND", (220, 605), (260, 605), (260, 635), (420, 635)))
    parts.append(wire("GND", (220, 605), (250, 605), (250, 715), (420, 715)))
    parts.append(wire("5V", (125, 660), (125, 620)))
    parts.append(wire("UART", (710, 625), (760, 625)))
    parts.append(label(718, 619, "D8"))
    parts.append(wire("GND", (710, 650), (760, 650)))
    for y in (330, 402, 474):
        parts.append(
            f'<path d="M710 {y} C 730 {y - 14}, 740 {y + 14}, 760 {y}" fill="none" stroke="#999" stroke-width="5"/>'
        )
    parts.append('<path d="M710 252 C 745 252, 730 300, 762 310" fill="none" stroke="#999" stroke-width="5"/>')
    legend = [label(640 + 62 * i, 34, kind, kind) for i, kind in enumerate(COLOR)]
    parts += [label(30, 34, "Tray of the example configuration, all on I2C bus 1 (/dev/i2c-1) at 400 kHz"), *legend]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif"'
        ' font-size="14">\n'
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>\n' + "\n".join(parts) + "\n</svg>\n"
    )


if __name__ == "__main__":
    Path(__file__).with_name("wiring.svg").write_text(drawing(), encoding="utf-8")
