"""The exceptions whose message is meant for the user."""

import errno

STORAGE_FAILS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # error numbers of an OSError


class InputError(Exception):
    """An input cannot be used: a file, a setting, a log.

    The message is one line: what is wrong, where, and what to do. The commands print it on stderr and exit with
    code 2, without a traceback and without having written a file.
    """


class StorageError(InputError):
    """A file cannot be written because the disk is full or fails, which is not a mistake in the input.

    The commands print the message on stderr, exit with code 1, and leave no part of the file.
    """
