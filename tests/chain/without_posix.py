"""Runs our commands as on Windows, as far as Linux can show it: `python without_posix.py`.

Standard input is a JSON list of commands, each a list of words; standard output is a list of [exit code, stdout,
stderr].

Modules that only POSIX has cannot be imported, functions that only POSIX has are missing from `os` and `signal`, and a
text file opened by our code without an encoding is an error, because Windows then uses another encoding.
"""

import contextlib
import importlib
import io
import json
import os
import signal
import sys
import traceback
import warnings
from importlib.abc import MetaPathFinder

MODULES = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "serial", "smbus2", "syslog", "termios", "tty"}
OF_OS = """
    chown chroot fchmod fchown fdatasync fork forkpty getloadavg getpgid initgroups
    killpg lockf mkfifo mknod nice openpty pipe2 pread preadv pwrite pwritev sched_getaffinity sched_param
    sched_setaffinity sched_setscheduler sched_yield setsid statvfs sync ttyname wait3 wait4
    O_CLOEXEC O_DIRECTORY O_DSYNC O_NOCTTY O_NONBLOCK O_SYNC SCHED_FIFO SCHED_OTHER
"""
OF_SIGNAL = """
    SIGALRM SIGCHLD SIGHUP SIGKILL SIGPIPE SIGQUIT SIGUSR1 SIGUSR2 SIGXCPU alarm pause pthread_kill pthread_sigmask
    setitimer sigpending sigwait
"""
COMMANDS = {
    "analyze": "flightpower.analysis.cli.analyze",
    "calibrate": "flightpower.analysis.cli.calibrate",
    "flightpower": "flightpower.command",
    "sim": "flightpower.simulate",
}


class OnlyOnPosix(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in MODULES:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def block() -> None:
    for name in MODULES - {"posix"}:
        sys.modules.pop(name, None)
    sys.meta_path.insert(0, OnlyOnPosix())
    for module, names in ((os, OF_OS), (signal, OF_SIGNAL)):
        for name in names.split():
            if hasattr(module, name):
                delattr(module, name)
    warnings.filterwarnings("error", category=EncodingWarning, module=r"flightpower\b")


def outcome(command: list[str]) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command, as if it ran in its own process."""
    out, err, code = io.StringIO(), io.StringIO(), 0
    sys.argv = command
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            importlib.import_module(COMMANDS[command[0]]).main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        except Exception:
            traceback.print_exc()
            code = 1
    return code, out.getvalue(), err.getvalue()


if __name__ == "__main__":
    block()
    print(json.dumps([outcome(command) for command in json.load(sys.stdin)]))
