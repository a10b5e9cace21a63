"""The messages of one topic in memory: a sequence of entries that is kept as columns of numbers.

A message object of ten numbers takes 400 bytes, but only 80 bytes in columns: a log of two hours fits into the memory
of a laptop, and the analysis takes a field of all messages at once. No NumPy: the daemon reads logs too.
"""

import math
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from operator import attrgetter
from types import NoneType
from typing import Any, NamedTuple, get_args, overload

import msgspec

from flightpower.flight.messages import Message, Status

STATUSES = tuple(Status)
STATUS_CODE = {status: code for code, status in enumerate(STATUSES)}
NO_INTEGER = -(2**63)  # stands for null in a column of integers
BATCH = 512  # number of messages that are turned into columns at a time


class LogEntry(NamedTuple):
    """One message of a topic, the Unix time at which it was taken, and the number of its tick."""

    time_ns: int
    tick: int
    message: Message


class Column:
    """One field of all messages: float64, int64 with NO_INTEGER for null, or the JSON text of anything else.

    Integers beyond 64 bits turn the whole column into JSON texts.
    """

    def __init__(self, kind: Any):
        self._kind = kind
        kinds = set(get_args(kind) or (kind,)) - {NoneType}
        self.values: array[Any] | list[bytes] = array("d") if kinds == {float} else array("q") if kinds == {int} else []

    @property
    def numbers(self) -> "array[Any] | None":
        """The column if it holds numbers: an array of type "d" with NaN for null, or "q" with NO_INTEGER for null."""
        return None if isinstance(self.values, list) else self.values

    def extend(self, values: Sequence[Any]) -> None:
        if isinstance(self.values, list):
            self.values.extend(map(msgspec.json.encode, values))
            return
        null = math.nan if self.values.typecode == "d" else NO_INTEGER
        before = len(self.values)
        try:
            self.values.extend([null if value is None else value for value in values] if None in values else values)
        except OverflowError:
            earlier = self[:before]
            self.values = []
            self.extend([*earlier, *values])

    def __getitem__(self, rows: slice) -> list[Any]:
        if isinstance(self.values, list):
            decoder = msgspec.json.Decoder(self._kind)
            return [decoder.decode(text) for text in self.values[rows]]
        if self.values.typecode == "d":
            return [None if value != value else value for value in self.values[rows]]
        return [None if value == NO_INTEGER else value for value in self.values[rows]]

    def reorder(self, order: list[int]) -> None:
        if isinstance(self.values, list):
            self.values = [self.values[i] for i in order]
        else:
            self.values = array(self.values.typecode, [self.values[i] for i in order])


class Entries(Sequence[LogEntry]):
    """The entries of one topic, all of one type of message. Each access to an entry creates a new message object."""

    def __init__(self, kind: type[Message]):
        self.kind = kind
        self.time_ns, self.tick, self.status = array("Q"), array("L"), array("B")
        self.columns = {
            field.name: Column(field.type) for field in msgspec.structs.fields(kind) if field.name != "status"
        }
        self._fields: Callable[[Message], Any] = attrgetter(*self.columns, "status")
        self._pending: list[Message] = []

    def extend(self, times_ns: Sequence[int], ticks: Sequence[int], messages: Sequence[Message]) -> None:
        """Add entries; their columns are complete after `finish`."""
        self.time_ns.extend(times_ns)
        self.tick.extend(ticks)
        self._pending += messages
        if len(self._pending) >= BATCH:
            self._flush()

    def _flush(self) -> None:
        if self._pending:
            *columns, status = zip(*map(self._fields, self._pending), strict=True)
            for column, values in zip(self.columns.values(), columns, strict=True):
                column.extend(values)
            self.status.extend(map(STATUS_CODE.__getitem__, status))
            self._pending.clear()

    def finish(self) -> None:
        """Complete the columns, sorted by time; entries with equal times stay in the order in which they were added."""
        self._flush()
        times = self.time_ns
        if all(map(int.__le__, times, memoryview(times)[1:])):
            return
        order = sorted(range(len(times)), key=times.__getitem__)
        self.time_ns, self.tick, self.status = (
            array(values.typecode, [values[i] for i in order]) for values in (times, self.tick, self.status)
        )
        for column in self.columns.values():
            column.reorder(order)

    def __len__(self) -> int:
        return len(self.time_ns)

    def __iter__(self) -> Iterator[LogEntry]:
        for start in range(0, len(self), BATCH):
            yield from self._made(slice(start, start + BATCH))

    @overload
    def __getitem__(self, index: int) -> LogEntry: ...

    @overload
    def __getitem__(self, index: slice) -> list[LogEntry]: ...

    def __getitem__(self, index: int | slice) -> LogEntry | list[LogEntry]:
        if isinstance(index, slice):
            return list(self._made(index))
        i = range(len(self))[index]
        return next(iter(self._made(slice(i, i + 1))))

    def _made(self, rows: slice) -> Iterable[LogEntry]:
        names = (*self.columns, "status")
        columns = [column[rows] for column in self.columns.values()]
        statuses = [STATUSES[code] for code in self.status[rows]]
        for time_ns, tick, *values in zip(self.time_ns[rows], self.tick[rows], *columns, statuses, strict=True):
            yield LogEntry(time_ns, tick, self.kind(**dict(zip(names, values, strict=True))))


NO_ENTRIES = Entries(Message)  # the entries of a topic that the log lacks


def entries_of(entries: Sequence[LogEntry]) -> Entries:
    """Return entries that were made one by one as columns."""
    made = Entries(type(entries[0].message) if entries else Message)
    made.extend(*map(list, zip(*entries, strict=True)) if entries else ([], [], []))
    made.finish()
    return made
