"""The folder of a simulated flight: after an interruption or on a full disk the next call is not refused."""

import errno
from pathlib import Path

import pytest

from flightpower.flight.errors import InputError, StorageError
from flightpower.sim.output_folder import LOG, PROBE, TRAY, TRUTH, UNFINISHED, check_output, whole_or_nothing


def test_what_is_interrupted_leaves_nothing(tmp_path: Path) -> None:
    output = tmp_path / "flown"
    with pytest.raises(KeyboardInterrupt), whole_or_nothing(output):
        for name in (TRUTH, TRAY, LOG, PROBE):
            (output / name).touch()
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_on_a_full_disk_what_was_there_before_stays(tmp_path: Path) -> None:
    (tmp_path / PROBE).write_text("mine")
    with pytest.raises(StorageError, match="No space left"), whole_or_nothing(tmp_path):
        (tmp_path / TRUTH).touch()
        raise OSError(errno.ENOSPC, "No space left on device")
    assert [path.name for path in tmp_path.iterdir()] == [PROBE]


def test_a_killed_simulation_is_replaced_and_a_whole_one_is_not(tmp_path: Path) -> None:
    """SIGKILL lets nothing be removed: a mark tells that the files are not complete."""
    for name in (TRUTH, UNFINISHED):
        (tmp_path / name).touch()
    check_output(tmp_path, replace=False)
    with whole_or_nothing(tmp_path):
        pass
    assert not (tmp_path / UNFINISHED).exists()
    with pytest.raises(InputError, match=f"already contains {TRUTH}"):
        check_output(tmp_path, replace=False)
