"""The notebook runs, and other programs read what it exports: values, units in the names, times of the log."""

import json
import os
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pandas as pd
import pytest
from mcap.reader import make_reader
from scipy import special
from scipy.io import loadmat

from flightpower.analysis.pages.exports.derived import LAYOUTS
from flightpower.analysis.pages.exports.tables import WITHOUT_UNIT
from flightpower.flight.units import UNIT_OF_SUFFIX
from flightpower.sim.sensors import draw, load_budget

pytestmark = pytest.mark.xdist_group("chain")

ROOT = Path(__file__).parents[2]
NOTEBOOK = ROOT / "docs" / "notebooks" / "one-flight.ipynb"
TABLES = {"synchronized", "states", "derived", "runs", "curves"}
DEMONSTRATION_SEED = 0
UNITS = {*UNIT_OF_SUFFIX, "W", "kgpm3"}


@pytest.fixture(scope="module")
def exports(flown: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder to which the notebook exported the flight, run cell by cell here: a kernel takes two seconds to
    start."""
    folder = tmp_path_factory.mktemp("exports")
    names: dict[str, object] = {}
    with patch.dict(os.environ, FLIGHTPOWER_LOG=str(flown / "log.mcap"), FLIGHTPOWER_EXPORTS=str(folder)):
        for i, cell in enumerate(json.loads(NOTEBOOK.read_text("utf-8"))["cells"]):
            if cell["cell_type"] == "code":
                exec(compile("".join(cell["source"]), f"{NOTEBOOK.name}, cell {i}", "exec"), names)
    return folder


@pytest.fixture(scope="module")
def parquet(exports: Path) -> dict[str, pd.DataFrame]:
    return {path.stem: pd.read_parquet(path) for path in (exports / "parquet").iterdir()}


@pytest.fixture(scope="module")
def messages(exports: Path) -> dict[str, list[tuple[int, dict]]]:
    """Time and content of the derived log's messages by topic, by the stock reader."""
    result = defaultdict(list)
    with (exports / "derived.mcap").open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None and schema.encoding == "jsonschema"
            content = json.loads(message.data)
            assert set(content) <= set(json.loads(schema.data)["properties"])
            result[channel.topic].append((message.log_time, content))
    return result


@pytest.mark.slow
def test_every_column_names_its_unit(parquet: dict[str, pd.DataFrame]) -> None:
    assert set(parquet) == TABLES
    for table in parquet.values():
        for column in table.columns:
            quantity = column.removesuffix("_standard_error")
            assert quantity in WITHOUT_UNIT or quantity.rpartition("_")[2] in UNITS, column


def test_derived_quantities_are_those_that_the_simulator_flew(flown: Path, parquet: dict[str, pd.DataFrame]) -> None:
    """The rms over the runs of the ratio of error to standard error, for six quantities in one flight.

    Most of an error is common to all instants of a flight, so the rms scatters at most as much as the magnitude of one
    standard normal number, however many instants there are. The six share sensor errors; Bonferroni's bound holds for
    any correlation: right standard errors fail in at most 5 % of flights. Angles are those of the IMU's forward axis,
    which is tilted in the airframe.
    """
    quantities = (
        ("V_mps", "V_mps"), ("alpha_rad", "alpha_rad"), ("theta_rad", "pitch_rad"), ("thrust_N", "thrust_N"),
        ("C_L", "CL"), ("C_D", "CD"),
    )  # fmt: skip
    limit = float(special.ndtri(1 - 0.05 / len(quantities) / 2))
    truth, derived = pd.read_parquet(flown / "truth.parquet"), parquet["derived"]
    tilt_rad = float(draw(load_budget("bench"), DEMONSTRATION_SEED).imu_rotation[0, 2])
    truth[["alpha_rad", "pitch_rad"]] -= tilt_rad
    runs = parquet["runs"][parquet["runs"]["kind"].isin(["acceleration", "deceleration"])]
    t = derived["t_s"].to_numpy()
    flown_then = np.any([(t > run.start_s) & (t < run.end_s) for run in runs.itertuples()], axis=0)
    for name, column in quantities:
        true = np.interp(t, truth["time_s"], truth[column])[flown_then]
        error = derived[name].to_numpy()[flown_then] - true
        sigma = derived[f"{name}_standard_error"].to_numpy()[flown_then]
        assert np.sqrt(np.mean((error / sigma) ** 2)) < limit, name
        assert np.sqrt(np.mean(sigma**2)) < 0.15 * np.abs(true).mean(), name


def test_csv_and_matlab_files_hold_the_same_as_parquet(exports: Path, parquet: dict[str, pd.DataFrame]) -> None:
    matlab = loadmat(exports / "flight.mat", squeeze_me=True, struct_as_record=False)
    for name, table in parquet.items():
        text = pd.read_csv(exports / "csv" / f"{name}.csv")
        assert list(text.columns) == list(table.columns)
        assert set(matlab[name]._fieldnames) == set(table.columns)
        for column in table.select_dtypes(float):
            expected = table[column].to_numpy()
            np.testing.assert_allclose(text[column], expected, rtol=1e-8)
            np.testing.assert_array_equal(getattr(matlab[name], column), expected)
    assert list(matlab["runs"].kind) == list(parquet["runs"]["kind"])


def test_the_curve_is_that_of_the_results(flown: Path, parquet: dict[str, pd.DataFrame]) -> None:
    curves = parquet["curves"]
    curve = curves[curves["curve"] == "power required, as flown"].drop(columns="curve")
    results = json.loads((flown / "log.report" / "results.json").read_bytes())
    assert curve.to_dict("records") == results["curves"]["power_required"]["points"]


def test_the_derived_log_has_the_times_of_the_log(flown: Path, messages, parquet: dict[str, pd.DataFrame]) -> None:
    derived = parquet["derived"]
    with (flown / "log.mcap").open("rb") as stream:
        imu = [message.log_time for _, _, message in make_reader(stream).iter_messages(topics=["/imu"])]
        stream.seek(0)
        gps = {m.log_time: json.loads(m.data) for _, _, m in make_reader(stream).iter_messages(topics=["/gps"])}
    for topic, name in (("/derived/V", "V_mps"), ("/derived/C_D", "C_D"), ("/derived/thrust", "thrust_N")):
        defined = derived[["t_s", name]][derived[name].notna()]
        assert [content[name] for _, content in messages[topic]] == defined[name].to_list()
        assert messages[topic][0][0] == imu[0] + round(1e9 * defined["t_s"].iloc[0])
    fixes = messages["/derived/location"]
    assert len(fixes) > 0.9 * len(gps)
    for time_ns, fix in fixes[:: len(fixes) // 20]:
        solution = gps[time_ns]
        assert (fix["latitude"], fix["longitude"]) == (solution["latitude_deg"], solution["longitude_deg"])
        assert fix["altitude"] == solution["height_m"]
        assert fix["timestamp"]["sec"] * 10**9 + fix["timestamp"]["nsec"] == time_ns
        covariance = np.reshape(fix["position_covariance"], (3, 3))
        assert covariance[2, 2] == solution["vertical_accuracy_m"] ** 2 and fix["position_covariance_type"] == 2
        assert np.trace(covariance[:2, :2]) == pytest.approx(solution["horizontal_accuracy_m"] ** 2)


# The settings of a Plot panel in Foxglove Studio's own default layout (packages/studio-base/src/providers/
# CurrentLayoutProvider/defaultLayout.ts), and those of its map panel that published layouts have.
FOXGLOVE_SETTINGS = {
    "Plot": {
        "title", "paths", "showXAxisLabels", "showYAxisLabels", "showLegend", "legendDisplay",
        "showPlotValuesInLegend", "isSynced", "xAxisVal", "sidebarDimension",
    },
    "map": {
        "customTileUrl", "disabledTopics", "followTopic", "layer", "topicColors", "zoomLevel", "maxNativeZoom",
    },
}  # fmt: skip
# Elements and attributes of layouts that PlotJuggler 3 has saved, in public repositories.
PLOTJUGGLER_ATTRIBUTES: dict[str, set[str]] = {
    "root": set(), "tabbed_widget": {"name", "parent"}, "Tab": {"tab_name", "containers"}, "Container": set(),
    "DockSplitter": {"orientation", "sizes", "count"}, "DockArea": {"name"},
    "plot": {"mode", "style", "flip_x", "flip_y"}, "range": {"left", "right", "bottom", "top"}, "limitY": set(),
    "curve": {"name", "color"}, "currentTabIndex": {"index"}, "use_relative_time_offset": {"enabled"},
    "Plugins": set(), "plugin": {"ID"}, "previouslyLoaded_Datafiles": set(), "previouslyLoaded_Streamer": set(),
    "customMathEquations": set(), "snippets": set(),
}  # fmt: skip


def panels(node: str | dict) -> Iterator[str]:
    """The panels in a layout of Foxglove: a tree of splits (react-mosaic)."""
    if isinstance(node, str):
        yield node
        return
    assert set(node) <= {"direction", "first", "second", "splitPercentage"}
    assert node["direction"] in ("row", "column") and 0 < node.get("splitPercentage", 50) < 100
    yield from panels(node["first"])
    yield from panels(node["second"])


def test_the_layout_of_foxglove_shows_topics_that_are_there(exports: Path, messages) -> None:
    layout = json.loads((exports / LAYOUTS[0]).read_bytes())
    assert set(layout) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert sorted(panels(layout["layout"])) == sorted(layout["configById"])
    for name, config in layout["configById"].items():
        kind, _, identity = name.partition("!")
        assert set(config) <= FOXGLOVE_SETTINGS[kind] and identity
        for path in config.get("paths", []):
            topic, _, field = path["value"].partition(".")
            assert field in messages[topic][0][1], path
            assert path["timestampMethod"] in ("receiveTime", "headerStamp") and path["enabled"] is True
            assert set(path) <= {"value", "enabled", "timestampMethod", "label", "color"}
        assert config.get("followTopic", "/derived/V") in messages
        assert config.get("layer", "map") in ("map", "satellite", "custom")


def test_the_layout_of_plotjuggler_shows_series_that_are_there(exports: Path, messages) -> None:
    root = ET.parse(exports / LAYOUTS[1]).getroot()
    assert root.tag == "root" and root[0].tag == "tabbed_widget"
    for element in root.iter():
        assert set(element.attrib) == PLOTJUGGLER_ATTRIBUTES[element.tag], element.tag
    for tab in root.iter("Tab"):
        containers = tab.findall("Container")
        assert len(containers) == int(tab.get("containers", ""))
        (splitter,) = containers[0]
        sizes = [float(size) for size in splitter.get("sizes", "").split(";")]
        assert splitter.tag == "DockSplitter" and splitter.get("orientation") in ("-", "|")
        assert len(sizes) == int(splitter.get("count", "")) == len(splitter) and sum(sizes) == pytest.approx(
            1, abs=1e-5
        )
        for area in splitter:
            (plot,) = area
            assert (area.tag, plot.tag, plot.get("mode")) == ("DockArea", "plot", "TimeSeries")
            assert plot.find("range") is not None and plot.find("limitY") is not None
    for curve in root.iter("curve"):
        topic, _, field = curve.get("name", "").rpartition("/")
        assert field in messages[topic][0][1], curve.attrib
