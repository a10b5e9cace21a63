"""Runs one of our commands as on Windows, as far as Linux can show it: `python without_posix.py COMMAND …`.

Modules that only POSIX has cannot be imported, functions that only POSIX has are missing from `os` and `signal`, and a
text file opened by our code without an encoding is an error, because Windows then takes another one.
"""

import importlib
import os
import signal
import sys
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
OURS = "analysis|daq|flight|flightpower|hw_fakes|sim"
COMMANDS = {
    "analyze": "analysis.cli.analyze",
    "calibrate": "analysis.cli.calibrate",
    "flightpower": "flightpower.__main__",
    "sim": "sim.__main__",
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
    warnings.filterwarnings("error", category=EncodingWarning, module=rf"({OURS})\b")


if __name__ == "__main__":
    block()
    command = sys.argv[1]
    sys.argv = sys.argv[1:]
    importlib.import_module(COMMANDS[command]).main()
