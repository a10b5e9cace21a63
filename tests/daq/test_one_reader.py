"""One reader at a time: a second program on the tray's devices is refused, and the recording is not disturbed."""

import errno
import socket
from contextlib import ExitStack
from pathlib import Path

import pytest
from test_commands_in_trouble import GIVE_UP_S, counter, daq, running, tray_file, wait_for  # noqa: F401

from flightpower.daq.bus import IN_USE
from flightpower.daq.linux_bus import LinuxBuses, LinuxI2C
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import Status
from flightpower.hw_fakes.fuse_i2c import UNAVAILABLE, FuseI2C
from flightpower.hw_fakes.i2c import FakeI2CBus

STOP = "sudo systemctl stop flightpower-daq"


@pytest.fixture
def bus_file(tmp_path):
    with ExitStack() as stack:
        try:
            yield stack.enter_context(FuseI2C(FakeI2CBus({}), tmp_path / "i2c-9")).path
        except OSError as error:
            if error.errno not in UNAVAILABLE:
                raise
            pytest.skip(f"no FUSE here: {error}")


def test_a_bus_is_opened_by_one_program_only(bus_file, tmp_path):
    first = LinuxI2C(str(bus_file))
    with pytest.raises(OSError, match=IN_USE) as caught:
        LinuxI2C(str(bus_file))
    assert caught.value.errno == errno.EBUSY and caught.value.filename == str(bus_file)
    first.close()
    buses = LinuxBuses()
    (tmp_path / "i2c-arm").symlink_to(bus_file)
    bus = buses.i2c(str(bus_file))
    try:
        assert buses.i2c(str(tmp_path / "i2c-arm")) is bus
    finally:
        bus.close()  # otherwise the file system could not be unmounted


def test_a_udp_port_and_receiver_files_are_opened_by_one_program_only(tmp_path):
    (tmp_path / "ch0").write_text("1500\n")
    first = LinuxBuses().port(f"rcio:{tmp_path}", 0)
    with pytest.raises(OSError, match=IN_USE):
        LinuxBuses().port(f"rcio:{tmp_path}", 0)
    first.close()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        with pytest.raises(OSError, match=IN_USE):
            LinuxBuses().port(f"udp:127.0.0.1:{other.getsockname()[1]}", 0)


@pytest.mark.parametrize("command", [["run"], ["check", "--seconds", "1"], ["zero", "--seconds", "4"]])
def test_beside_a_recording_every_command_that_reads_the_tray_is_refused(tmp_path, counter, command):  # noqa: F811
    tray = tray_file(tmp_path, counter.path)
    log = tmp_path / "logs" / "log-0001.mcap"
    with running(tray) as (daemon, _):
        wait_for(lambda: log.exists() and log.stat().st_size > 7000)
        done = daq(*command, "-c", tray)
        assert done.returncode == 2
        assert IN_USE in done.stderr and STOP in done.stderr and counter.path in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
        daemon.terminate()
        assert daemon.wait(GIVE_UP_S) == 0
    assert [path.name for path in log.parent.iterdir()] == [log.name]
    statuses = [entry.message.status for entry in read_log(log).entries["/rpm"]]
    assert set(statuses[5:]) <= {Status.OK, Status.NO_DATA}


@pytest.mark.slow
def test_the_service_tries_again_when_something_else_reads_and_not_when_its_tray_is_wrong(
    tmp_path,
    counter,  # noqa: F811
    monkeypatch,
):
    """The exit code decides: the unit does not restart after code 2."""
    unit = (Path(__file__).parents[2] / "systemd" / "flightpower-daq.service").read_text()
    assert "\nRestartPreventExitStatus=2\n" in unit and "\nRestart=always\n" in unit
    address = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(address))
        tray = tray_file(tmp_path, counter.path)
        with running(tray) as (_, lines):
            wait_for(lambda: any("recording" in line for line in lines))
            monkeypatch.setenv("NOTIFY_SOCKET", str(address))
            done = daq("run", "-c", tray)
            assert done.returncode == 1 and STOP in done.stderr
        (tmp_path / "logs").rename(tmp_path / "kept")
        (tmp_path / "logs").write_text("a file where the directory should be")
        assert daq("run", "-c", tray).returncode == 1
        assert daq("run", "-c", tray_file(tmp_path, counter.path, 'aircraft = "albatross"')).returncode == 2
        tray.write_text("rate_Hz = \n")
        assert daq("run", "-c", tray).returncode == 2


def test_check_and_zero_read_a_tray_of_which_a_part_is_missing(tmp_path):
    """Only a device in use is refused; one that is not there is reported as such."""
    done = daq("check", "-c", tray_file(tmp_path, "/dev/ttyUSB-none"), "--seconds", "1")
    assert done.returncode == 1 and "not fit to fly" in done.stdout
