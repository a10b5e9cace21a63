"""Accesses lines of a GPIO chip through the kernel's character device (linux/gpio.h, version 2), without a library."""

import fcntl
import os
import struct
from enum import IntFlag

GET_LINES, GET_VALUES, SET_VALUES = 0xC250B407, 0xC010B40E, 0xC010B40F
OFFSETS, CONSUMER_BYTES, ATTRIBUTES_BYTES = 64, 32, 10 * 24
# gpio_v2_line_request: offsets, consumer, flags, number of attributes, attributes; lines, size of the buffer, file
REQUEST = struct.Struct(f"<{OFFSETS}I{CONSUMER_BYTES}sQI20x{ATTRIBUTES_BYTES}xII20xi")
VALUES = struct.Struct("<QQ")  # gpio_v2_line_values: bits, mask
ONE = 1  # the mask of a request's first line


class LineFlag(IntFlag):
    """The requested configuration of a line."""

    ACTIVE_LOW = 1 << 1
    INPUT = 1 << 2
    OUTPUT = 1 << 3
    BIAS_PULL_UP = 1 << 8


class GpioLine:
    """One line of a chip, such as /dev/gpiochip0. Raises OSError when there is none, or when it is in use."""

    def __init__(self, chip: str, line: int, flags: LineFlag):
        handle = os.open(chip, os.O_RDWR | os.O_CLOEXEC)
        try:
            request = bytearray(REQUEST.pack(line, *[0] * (OFFSETS - 1), b"flightpower", flags, 0, 1, 0, 0))
            fcntl.ioctl(handle, GET_LINES, request)
        finally:
            os.close(handle)
        self._file = REQUEST.unpack(request)[-1]

    def set(self, on: bool) -> None:
        fcntl.ioctl(self._file, SET_VALUES, bytearray(VALUES.pack(on, ONE)))

    def get(self) -> bool:
        values = bytearray(VALUES.pack(0, ONE))
        fcntl.ioctl(self._file, GET_VALUES, values)
        return bool(VALUES.unpack(values)[0] & ONE)

    def close(self) -> None:
        os.close(self._file)
