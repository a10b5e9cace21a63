"""Reads a PX4 log (ULog) as pyulog does, but many times faster: block by block, with all of a topic's rows at once.

pyulog reads the definitions, and the rest of a log from the first unexpected message on, so that a damaged log gives
the same result. https://docs.px4.io/main/en/dev_log/ulog_file_format.html
"""

import struct
from array import array
from collections import Counter
from collections.abc import Collection
from types import SimpleNamespace
from typing import Any, BinaryIO, ClassVar

import numpy as np
from pyulog import ULog


class BlockwiseULog(ULog):  # type: ignore[misc]
    """A log with these topics, or all; it also has the flight's information messages, dropouts and untagged texts."""

    BLOCK_BYTES: ClassVar[int] = 1 << 22  # bytes read into memory at a time

    def __init__(self, stream: BinaryIO, topics: Collection[str] | None):
        super().__init__(_Advancing(stream), None if topics is None else list(topics))

    def _read_file_data(self, topics: Collection[str] | None, read_until: int | None = None) -> None:
        stream = self._file_handle
        offset = stream.tell()
        end = (1 << 50) if read_until is None else read_until
        while len(block := stream.read(min(self.BLOCK_BYTES, max(end - offset, 0)))):
            done, expected = self._in_block(block, topics)
            offset += done
            stream.skip_to(offset)
            if not expected or not done:
                break
        super()._read_file_data(topics, read_until)

    def _in_block(self, block: bytes, topics: Collection[str] | None) -> tuple[int, bool]:
        """Return how many bytes of whole messages were read, and False if an unexpected message stopped the reading."""
        subscriptions, left_out = self._subscriptions, self._filtered_message_ids
        places = {number: array("Q") for number in subscriptions}
        sizes = {number: _sizes(subscription) for number, subscription in subscriptions.items()}
        offset, length, expected, data = 0, len(block), True, self.MSG_TYPE_DATA
        while offset + 5 <= length:
            size, begin = block[offset] | block[offset + 1] << 8, offset + 3
            if begin + size > length:
                break
            if block[offset + 2] == data:
                number = block[begin] | block[begin + 1] << 8
                if (limits := sizes.get(number)) is not None and limits[0] <= size <= limits[1]:
                    places[number].append(begin + 2)
                elif number not in left_out or size < 2:
                    expected = False
                    break
            else:
                try:
                    added = self._other(block[offset + 2], block[begin : begin + size], topics)
                except (IndexError, KeyError, ValueError, OverflowError, struct.error):
                    expected = False
                    break
                if added is not None:
                    places[added] = array("Q")
                    sizes[added] = _sizes(subscriptions[added])
            offset = begin + size
        packed = np.frombuffer(block, dtype=np.uint8)
        for number, begins in places.items():
            if len(begins):
                columns = np.arange(subscriptions[number].dtype.itemsize)
                rows = packed[np.asarray(begins, dtype=np.int64)[:, None] + columns]
                subscriptions[number].buffer += rows.tobytes()
        return offset, expected

    def _other(self, kind: int, data: bytes, topics: Collection[str] | None) -> int | None:
        """Process a message other than data, and return the number of the topic's instance if the message adds one.

        Raises exceptions that `_in_block` catches if the content is unexpected.
        """
        if kind == self.MSG_TYPE_ADD_LOGGED_MSG:
            added = self._MessageAddLogged(data, None, self._message_formats)
            if topics is not None and added.message_name not in topics:
                self._filtered_message_ids.add(added.msg_id)
                return None
            if added.msg_id in self._subscriptions:  # pyulog handles an instance that is added again
                raise ValueError
            self._subscriptions[added.msg_id] = added
            return int(added.msg_id)
        if kind == self.MSG_TYPE_INFO:
            info = self._MessageInfo(data, None)
            self._msg_info_dict[info.key] = info.value
        elif kind == self.MSG_TYPE_DROPOUT:
            self._dropouts.append(self.MessageDropout(data, None, self._last_timestamp))
        elif kind == self.MSG_TYPE_LOGGING:
            self._logged_messages.append(self.MessageLogging(data, SimpleNamespace(msg_size=len(data))))
        elif kind == self.MSG_TYPE_LOGGING_TAGGED:
            self.MessageLoggingTagged(data, SimpleNamespace(msg_size=len(data)))
        elif kind == self.MSG_TYPE_PARAMETER:
            self._MessageInfo(data, None)
        elif kind == self.MSG_TYPE_PARAMETER_DEFAULT:
            self._MessageParameterDefault(data, None)
        elif kind == self.MSG_TYPE_INFO_MULTIPLE:
            self._MessageInfo(data, None, is_info_multiple=True)
        elif kind != self.MSG_TYPE_SYNC:
            raise ValueError
        return None


def _sizes(subscription: Any) -> tuple[int, int]:
    """Return the least and greatest size of a topic's data messages [bytes]: padding at the end may be missing."""
    return subscription.dtype.itemsize + 2, subscription.max_data_size + 2


class _Advancing:
    """A file that ends pyulog's endless loop at a damaged end, where it goes back more bytes than it has read."""

    def __init__(self, stream: BinaryIO):
        self.read, self.tell, self.close, self.skip_to = stream.read, stream.tell, stream.close, stream.seek
        self._seek, self._visits = stream.seek, Counter[int]()

    def seek(self, offset: int, whence: int = 0) -> int:
        """Move to a place in the file. Raises EOFError on coming back to the same place too often."""
        place = self._seek(offset, whence)
        self._visits[place] += 1
        if self._visits[place] > 10:  # each pass comes to a place once, and the search for a sync mark once more
            raise EOFError("its end is damaged")
        return place
