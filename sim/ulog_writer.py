"""Writes a log in PX4's ULog format (version 1): definitions, subscriptions, then all messages in order of time.

Format: https://docs.px4.io/main/en/dev_log/ulog_file_format
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightpower.sim.log_faults import Dropout

MAGIC_AND_VERSION = b"ULog\x01\x12\x35\x01"
TYPE_NAMES = {"float32": "float", "float64": "double", "uint8": "uint8_t", "int8": "int8_t", "int32": "int32_t",
              "uint32": "uint32_t", "uint64": "uint64_t", "bool": "bool"}  # fmt: skip


@dataclass(frozen=True)
class UlogTopic:
    """Messages of one instance of a topic. time_us: (n,); columns: values (n,) by field, in the type to be written"""

    name: str
    time_us: NDArray[np.uint64]
    columns: dict[str, NDArray[np.generic]]
    instance: int = 0

    def selected(self, selection: NDArray[np.bool_]) -> "UlogTopic":
        return replace(
            self, time_us=self.time_us[selection], columns={name: x[selection] for name, x in self.columns.items()}
        )

    def at(self, time_us: NDArray[np.uint64]) -> "UlogTopic":
        """These messages at other times."""
        return replace(self, time_us=time_us)


@dataclass(frozen=True)
class UlogContents:
    topics: Sequence[UlogTopic]
    info: dict[str, str] = field(default_factory=dict)
    dropouts: Sequence[Dropout] = ()
    parameters: dict[str, float] = field(default_factory=dict)
    appended: Sequence[str] = ()  # text messages written after the log was closed, as happens after a crash


def write_ulog(path: Path, contents: UlogContents) -> None:
    """Write a log. Raises OSError where the file cannot be written."""
    formats = {topic.name: _format(topic) for topic in contents.topics}
    start_us = min(int(topic.time_us.min()) for topic in contents.topics)
    header, flags = MAGIC_AND_VERSION + struct.pack("<Q", start_us), len(_message("B", bytes(40)))
    out = [_message("F", text.encode()) for text in formats.values()]
    for key, value in contents.info.items():
        typed_key = f"char[{len(value)}] {key}".encode()
        out.append(_message("I", bytes([len(typed_key)]) + typed_key + value.encode()))
    for key, setting in contents.parameters.items():
        typed_key = f"float {key}".encode()
        out.append(_message("P", bytes([len(typed_key)]) + typed_key + struct.pack("<f", setting)))
    timed: list[tuple[int, bytes]] = []
    for number, topic in enumerate(contents.topics):
        out.append(_message("A", struct.pack("<BH", topic.instance, number) + topic.name.encode()))
        rows = _rows(topic)
        start = struct.pack("<HBH", rows.dtype.itemsize + 2, ord("D"), number)
        timed += [(int(t), start + row.tobytes()) for t, row in zip(topic.time_us, rows, strict=True)]
    timed += [(dropout.time_us, _message("O", struct.pack("<H", dropout.duration_ms))) for dropout in contents.dropouts]
    timed.sort(key=lambda entry: entry[0])
    body = b"".join(out + [data for _, data in timed])
    end_us = timed[-1][0] if timed else start_us
    appended = b"".join(
        _message("L", struct.pack("<BQ", ord("3"), end_us) + text.encode()) for text in contents.appended
    )
    offset = len(header) + flags + len(body) if appended else 0
    incompatible = bytes([bool(appended)]) + bytes(7)
    path.write_bytes(
        header + _message("B", bytes(8) + incompatible + struct.pack("<3Q", offset, 0, 0)) + body + appended
    )


def _message(kind: str, payload: bytes) -> bytes:
    return struct.pack("<HB", len(payload), ord(kind)) + payload


def _format(topic: UlogTopic) -> str:
    """`name:uint64_t timestamp;float[3] xyz;`: adjacent columns `xyz[0]` to `xyz[2]` become one array. Columns of a
    nested message, `esc[0].esc_rpm`, keep their full names.
    """
    fields, counts = ["uint64_t timestamp"], dict[str, int]()
    types: dict[str, str] = {}
    for name, values in topic.columns.items():
        array = "[" in name and "." not in name
        base = name.partition("[")[0] if array else name
        counts[base] = counts.get(base, 0) + 1
        types[base] = TYPE_NAMES[values.dtype.name] + ("[]" if array else "")
    for base, kind in types.items():
        fields.append(f"{kind.replace('[]', f'[{counts[base]}]')} {base}")
    return f"{topic.name}:" + "".join(f"{field};" for field in fields)


def _rows(topic: UlogTopic) -> NDArray[np.void]:
    kinds = [("timestamp", "<u8"), *((name, values.dtype.str) for name, values in topic.columns.items())]
    rows = np.zeros(len(topic.time_us), dtype=np.dtype(kinds))
    rows["timestamp"] = topic.time_us
    for name, values in topic.columns.items():
        rows[name] = values
    return rows
