"""The folder of a simulated flight: nothing is replaced unasked, and an interruption leaves nothing over."""

import errno
from pathlib import Path

import pytest

from flightpower.flight.errors import InputError, StorageError
from flightpower.sim.output_folder import CURVE, LOG, PROBE, TRAY, TRUTH, UNFINISHED, check_output, whole_or_nothing


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


@pytest.mark.parametrize("left", [TRUTH, CURVE, LOG, "log.ulg"])
def test_a_killed_simulation_is_replaced_only_if_asked(left: str, tmp_path: Path) -> None:
    """After SIGKILL nothing is removed. The log may be a recording in real time, which is worth keeping."""
    for name in (left, UNFINISHED):
        (tmp_path / name).touch()
    with pytest.raises(InputError, match=rf"already contains {left} of a simulation that was cut short.*--replace"):
        check_output(tmp_path, replace=False)
    check_output(tmp_path, replace=True)
    with whole_or_nothing(tmp_path):
        (tmp_path / TRUTH).touch()
    assert not (tmp_path / UNFINISHED).exists()
    with pytest.raises(InputError, match=f"already contains {TRUTH};"):
        check_output(tmp_path, replace=False)


def test_a_simulation_that_was_killed_before_it_wrote_is_in_nobodys_way(tmp_path: Path) -> None:
    (tmp_path / UNFINISHED).touch()
    check_output(tmp_path, replace=False)
