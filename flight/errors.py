"""The exception whose message is meant for the user."""


class InputError(Exception):
    """An input cannot be used: a file, a setting, a log.

    The message is one line: what is wrong, where, and what to do. The commands print it on stderr and exit with
    code 2, without a traceback and without having written a file.
    """
