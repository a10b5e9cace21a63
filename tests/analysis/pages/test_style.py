"""Colors can be distinguished on white, on a dark page and with color blindness; thinning keeps the visible shape."""

from itertools import combinations

import numpy as np
import pytest

from flightpower.analysis.pages.charts.style import GRAY, INK, ON_DARK, PALETTE, PAPER, RUN_COLOR, thinned

# From linear RGB to perceived color: Machado, Oliveira and Fernandes (2009), severity 1.
SEEN = {
    "normal": np.eye(3),
    "protanopia": np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                            [-0.003882, -0.048116, 1.051998]]),
    "deuteranopia": np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                              [-0.011820, 0.042940, 0.968881]]),
    "tritanopia": np.array([[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                            [0.004733, 0.691367, 0.303900]]),
}  # fmt: skip
LEAST_DIFFERENCE = 20.0  # CIE 1976; 2 is visible side by side, 10 at a glance
LEAST_CONTRAST = 3.0  # for graphics (WCAG 2.1, 1.4.11)


def linear(color: str) -> np.ndarray:
    value = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz = to_xyz @ np.clip(rgb, 0, 1) / [0.9505, 1.0, 1.089]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def luminance(color: str) -> float:
    return float(linear(color) @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("eye", SEEN)
@pytest.mark.parametrize("dark", [False, True])
def test_kinds_of_runs_are_distinguished_by_every_eye(eye: str, dark: bool) -> None:
    colors = [ON_DARK[color] if dark else color for color in RUN_COLOR.values()]
    for item, other in combinations([lab(SEEN[eye] @ linear(color)) for color in colors], 2):
        assert np.linalg.norm(item - other) > LEAST_DIFFERENCE


def test_every_color_is_seen_on_its_page() -> None:
    for color in {*PALETTE, *RUN_COLOR.values(), GRAY, INK}:
        for shade, page in ((color, PAPER), (ON_DARK[color], ON_DARK[PAPER])):
            light, dark = sorted((luminance(shade), luminance(page)), reverse=True)
            assert (light + 0.05) / (dark + 0.05) > LEAST_CONTRAST, (color, shade)


def test_thinning_keeps_peaks_order_and_gaps() -> None:
    x = np.arange(30_000.0)
    y = np.sin(x / 500)
    y[12_345], y[23_456], y[5000:7000] = 9.0, -9.0, np.nan
    t, thin_y = thinned(x, y, 1000)
    assert len(t) <= 1000 and (np.diff(t) > 0).all()
    assert np.nanmax(thin_y) == 9.0 and np.nanmin(thin_y) == -9.0
    assert np.isnan(thin_y[(t > 5100) & (t < 6900)]).all()
    assert len(thinned(x[:10], y[:10], 1000)[0]) == 10
