"""A fake GPIO chip as shown by the kernel's character device (linux/gpio.h, version 2), with its structures in C."""

import ctypes
import errno
import fcntl
import os
from typing import Any

U32, U64 = ctypes.c_uint32, ctypes.c_uint64
INPUT, OUTPUT, ACTIVE_LOW, PULL_UP = 0x4, 0x8, 0x2, 0x100  # GPIO_V2_LINE_FLAG_…


class Attribute(ctypes.Structure):
    _fields_ = [("id", U32), ("padding", U32), ("value", U64), ("mask", U64)]


class LineConfig(ctypes.Structure):
    _fields_ = [("flags", U64), ("num_attrs", U32), ("padding", U32 * 5), ("attrs", Attribute * 10)]


class LineRequest(ctypes.Structure):
    _fields_ = [
        ("offsets", U32 * 64), ("consumer", ctypes.c_char * 32), ("config", LineConfig), ("num_lines", U32),
        ("event_buffer_size", U32), ("padding", U32 * 5), ("fd", ctypes.c_int32),
    ]  # fmt: skip


class LineValues(ctypes.Structure):
    _fields_ = [("bits", U64), ("mask", U64)]


def _read_write(number: int, kind: type[ctypes.Structure]) -> int:
    """_IOWR of linux/ioctl.h for type 0xB4."""
    return 3 << 30 | ctypes.sizeof(kind) << 16 | 0xB4 << 8 | number


class FakeGpioChip:
    """A chip, with the levels of its pins by number: 1 is high. A pin without wiring floats at 0, or is pulled up.

    `install` puts it in the place of `path` for modules that use os.open and fcntl.ioctl.
    """

    def __init__(self, path: str, lines: int = 54):
        self.path, self.lines = path, lines
        self.driven: dict[int, list[bool]] = {}  # values to which each output was set, in order
        self.grounded: set[int] = set()  # pins connected to ground, as by a button
        self.failing = False
        self._requested: dict[int, tuple[int, int]] = {}  # number and flags of the requested line, by file

    def open(self, path: str, flags: int, *rest: Any) -> int:
        return self._file() if path == self.path else os.open(path, flags, *rest)

    def close(self, file: int) -> None:
        self._requested.pop(file, None)
        os.close(file)

    def ioctl(self, file: int, request: int, argument: bytearray) -> int:
        if self.failing:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        if request == _read_write(0x07, LineRequest):
            self._request(LineRequest.from_buffer(argument))
        elif request == _read_write(0x0E, LineValues):
            values = LineValues.from_buffer(argument)
            values.bits = self._level(*self._requested[file]) & values.mask
        elif request == _read_write(0x0F, LineValues):
            values = LineValues.from_buffer(argument)
            line, flags = self._requested[file]
            if not flags & OUTPUT:
                raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))
            if values.mask & 1:
                self.driven.setdefault(line, []).append(bool(values.bits & 1))
        else:
            fcntl.ioctl(file, request, argument)
        return 0

    def _file(self) -> int:
        return os.open(os.devnull, os.O_RDWR)

    def _request(self, wanted: LineRequest) -> None:
        line, flags = wanted.offsets[0], wanted.config.flags
        if wanted.num_lines != 1 or line >= self.lines or bool(flags & INPUT) == bool(flags & OUTPUT):
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        if line in {taken for taken, _ in self._requested.values()}:
            raise OSError(errno.EBUSY, os.strerror(errno.EBUSY))
        wanted.fd = self._file()
        self._requested[wanted.fd] = line, flags

    def _level(self, line: int, flags: int) -> int:
        high = line not in self.grounded and bool(flags & PULL_UP)
        return int(high != bool(flags & ACTIVE_LOW))
