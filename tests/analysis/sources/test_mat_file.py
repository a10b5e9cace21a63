"""Variables of .mat files are those of scipy's reader, and a damaged file ends in an error that is caught."""

import io
import random
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from flightpower.analysis.sources.mat_file import read_mat
from flightpower.analysis.sources.matlab_log import is_matlab_log

RNG = np.random.default_rng(0)
INSIDE: dict[str, object] = {
    "t": RNG.normal(size=50),
    "matrix": RNG.normal(size=(3, 40)),
    "small": np.arange(5, dtype=np.uint8),
    "whole": np.arange(-20, 20, dtype=np.int16),
    "single": RNG.normal(size=30).astype(np.float32),
    "scalar": 4.25,
    "text": "ArduPlane V4.5",
    "rows": np.array(["ab", "cde"]),
    "labels": np.array(["TimeUS", "I", "Airspeed"], dtype=object),
    "log": {"air": {"speed": RNG.normal(size=50)}, "x": 1.0},
    "empty": np.zeros((0, 3)),
}


def written(compressed: bool) -> bytes:
    stream = io.BytesIO()
    savemat(stream, INSIDE, do_compression=compressed)
    return stream.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
def test_variables_are_those_of_a_second_reader(compressed: bool) -> None:
    data = written(compressed)
    variables, other = read_mat(data), loadmat(io.BytesIO(data), squeeze_me=True, struct_as_record=False)
    for name in ("t", "matrix", "small", "whole", "single", "scalar"):
        assert (
            variables[name] == pytest.approx(other[name]) and variables[name].dtype == np.asarray(other[name]).dtype
        ), name
    assert variables["text"] == other["text"] and variables["rows"].tolist() == [row.rstrip() for row in other["rows"]]
    assert variables["labels"].tolist() == other["labels"].tolist() == ["TimeUS", "I", "Airspeed"]
    assert variables["log"]["air"]["speed"] == pytest.approx(other["log"].air.speed)
    assert variables["empty"].size == 0


def test_what_is_not_read_is_left_out() -> None:
    stream = io.BytesIO()
    savemat(stream, {"z": np.array([1 + 2j, 3.0]), "t": np.arange(3.0)})
    assert read_mat(stream.getvalue()).keys() == {"t"}


@pytest.mark.parametrize("compressed", [False, True])
def test_damage_ends_in_an_error_or_in_other_values(compressed: bool) -> None:
    """On some of these files scipy.io.loadmat ends the whole program."""
    data, draw, refused = written(compressed), random.Random(1), 0
    for _ in range(300):
        altered = bytearray(data)
        for _ in range(4):
            altered[draw.randrange(128, len(altered))] = draw.randrange(256)
        try:
            read_mat(bytes(altered[: draw.randrange(200, len(altered))]))
        except Exception:
            refused += 1
    assert refused > 100


def test_more_rows_than_characters_are_damage() -> None:
    """A character matrix of a billion rows took a minute, when it was read a row at a time."""
    stream = io.BytesIO()
    savemat(stream, {"rows": np.array(["ab", "cde"])}, do_compression=False)
    data = bytearray(stream.getvalue())
    offset = data.index(np.array([2, 3], dtype="<i4").tobytes())
    data[offset : offset + 4] = np.array([10**9], dtype="<i4").tobytes()
    with pytest.raises(ValueError, match="1000000000 rows of 6 characters"):
        read_mat(bytes(data))


def test_a_log_with_other_labels_than_columns_is_none(tmp_path: Path) -> None:
    """Labels are not texts, or there are more than columns: one damaged file had 18 million, which took half a
    minute."""
    columns = np.column_stack([1e6 + 2e5 * np.arange(60), np.full(60, 15.0)])
    labels = np.array(["TimeUS", "Airspeed"], dtype=object)
    for label, expected in (
        (labels, True),
        (np.ones((1000, 1000)), False),
        (np.array(["TimeUS"], dtype=object), False),
    ):
        savemat(tmp_path / "log.mat", {"ARSP": columns, "ARSP_label": label})
        assert is_matlab_log(tmp_path / "log.mat") is expected
