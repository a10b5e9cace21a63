"""Tests what a computation in a second process returns and raises, and what happens without a second process."""

import os
import subprocess
import sys
import textwrap

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="no process is forked elsewhere")


def printed(program: str, **environment: str) -> list[str]:
    """Return the words that a program prints that has two processors and `beside`."""
    setting = "import os\nos.sched_getaffinity = lambda _: {0, 1}\nfrom flightpower.analysis.beside import beside\n"
    done = subprocess.run(
        [sys.executable, "-c", setting + textwrap.dedent(program)],
        env=os.environ | {"FLIGHTPOWER_PROCESSES": "2"} | environment, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.stderr == ""
    return done.stdout.split()


def test_the_computation_is_done_by_another_process_while_this_one_goes_on() -> None:
    """The computation waits for a word that this process sends after starting it."""
    lines = printed("""
        receive, send = os.pipe()
        result = beside(lambda: (os.read(receive, 5).decode(), os.getpid()))
        os.write(send, b"later")
        word, process = result()
        print(word, process != os.getpid())
    """)
    assert lines == ["later", "True"]


@pytest.mark.parametrize(
    ("program", "environment"),
    [
        ("{}", {"FLIGHTPOWER_PROCESSES": "1"}),
        ("os.sched_getaffinity = lambda _: {{0}}\n{}", {}),
        ("import threading\nt = threading.Thread(target=exec, args=('''{}''', globals()))\nt.start()\nt.join()", {}),
    ],
)
def test_without_a_second_process_it_is_computed_when_it_is_asked_for(
    program: str, environment: dict[str, str]
) -> None:
    code = (
        "asked = []; result = beside(lambda: (len(asked), os.getpid())); asked.append(1); print(*result(), os.getpid())"
    )
    late, by, here = printed(program.format(code), **environment)
    assert (late, by) == ("1", here)


def test_a_process_that_is_itself_beside_another_starts_none() -> None:
    lines = printed("""
        inner = lambda: (os.getpid(), beside(os.getpid)())
        outer, within = beside(inner)()
        print(outer == within, outer != os.getpid())
    """)
    assert lines == ["True", "True"]


def test_its_error_is_raised_where_the_result_is_asked_for() -> None:
    lines = printed("""
        from flightpower.flight.errors import InputError
        def refuse():
            raise InputError("log.mcap: has no flight")
        result = beside(refuse)
        try:
            result()
        except InputError as error:
            print(error)
    """)
    assert lines == ["log.mcap:", "has", "no", "flight"]


def test_it_is_computed_here_if_its_process_is_killed() -> None:
    lines = printed("""
        import signal
        here = os.getpid()
        def compute():
            if os.getpid() != here:
                os.kill(os.getpid(), signal.SIGKILL)
            return os.getpid()
        print(beside(compute)() == here)
    """)
    assert lines == ["True"]


def test_what_nobody_asks_for_does_not_keep_the_program() -> None:
    assert printed("import time\nbeside(lambda: time.sleep(1000))\nprint('ended')") == ["ended"]


def test_the_other_process_ends_with_the_first_even_if_that_is_killed() -> None:
    """Otherwise the files it holds open would stay open, here the pipe of the output."""
    program = "import signal, time\nbeside(lambda: time.sleep(1000))\nos.kill(os.getpid(), signal.SIGKILL)"
    assert printed(program) == []
