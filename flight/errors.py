"""The one exception whose message is meant for the person at the keyboard."""


class InputError(Exception):
    """Something given to us cannot be used: a file, a setting, a log.

    The message is one line that says what is wrong, where, and what to do; the commands print it on stderr and
    leave with exit code 2, without a traceback and without having written anything.
    """
