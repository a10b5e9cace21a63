"""`sim fly --faults`: the faults of a file reach the log as statuses, at their time; a wrong file is refused."""

import pytest
from running import command, done

from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import Status

STAND = '[[segment]]\nkind = "stand"\nduration = "12 s"\n'
FAULTS = """
[[fault]]
kind = "no_acknowledge"
device = "baro"
start = "5 s"
duration = "2 s"

[[fault]]
kind = "no_fix"
device = "gps"
start = "8 s"
"""


def test_the_faults_of_a_file_reach_the_log(tmp_path):
    (tmp_path / "plan.toml").write_text(f'title = "stand"\n{STAND}')
    (tmp_path / "faults.toml").write_text(FAULTS)
    done("sim", "fly", "--plan", tmp_path / "plan.toml", "--faults", tmp_path / "faults.toml", "-o", tmp_path / "out")
    log = read_log(tmp_path / "out" / "log.mcap")
    begin_ns = log.entries["/daq/tick"][0].time_ns

    def statuses(topic, from_s, to_s):
        return {e.message.status for e in log.entries[topic] if from_s < (e.time_ns - begin_ns) * 1e-9 < to_s}

    assert statuses("/baro", 5.1, 6.9) == {Status.NO_REPLY}
    assert Status.OK in statuses("/baro", 7.0 + 2.0, 11) and Status.NO_REPLY not in statuses("/baro", 7.0 + 2.0, 11)
    assert statuses("/gps", 4.0, 8.0) == {Status.OK}
    assert statuses("/gps", 8.3, 12.0) == {Status.NO_DATA}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('[[fault]]\nkind = "gremlins"\ndevice = "baro"\nstart = "1 s"\n', "brown_out"),
        ('[[fault]]\nkind = "no_fix"\ndevice = "baro"\nstart = "1 s"\n', "to gps"),
        ('[[fault]]\nkind = "no_fix"\ndevice = "gps"\nstart = "1 m"\n', "start"),
        ("[[fault]\n", "TOML"),
    ],
)
def test_a_wrong_file_is_one_clear_line_and_nothing_is_flown(tmp_path, text, expected):
    path = tmp_path / "faults.toml"
    path.write_text(text)
    outcome = command("sim", "fly", "--faults", path, "-o", tmp_path / "out")
    assert outcome.returncode == 2 and outcome.stderr.count("\n") == 1
    assert "faults.toml" in outcome.stderr and expected in outcome.stderr
    assert not (tmp_path / "out").exists()
