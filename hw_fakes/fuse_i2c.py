"""A fake I2C bus as a device file that works like /dev/i2c-N, for unmodified smbus2 in another process.

The file is the root of a FUSE file system, mounted over an ordinary file, and is served straight through /dev/fuse (the
kernel's include/uapi/linux/fuse.h, protocol 7.31). The numbers of the ioctls in linux/i2c-dev.h contain no
sizes, so the kernel passes only the caller's process and the address of its argument; messages are read and replies
written with process_vm_readv and process_vm_writev. This needs root.
"""

import ctypes
import errno
import os
import stat
import struct
import threading
import time
from pathlib import Path

from flightpower.hw_fakes.i2c import I2CBus

# linux/i2c-dev.h and linux/i2c.h
I2C_RETRIES, I2C_TIMEOUT, I2C_SLAVE, I2C_FUNCS, I2C_SLAVE_FORCE, I2C_RDWR = (
    0x0701,
    0x0702,
    0x0703,
    0x0705,
    0x0706,
    0x0707,
)
I2C_FUNC_I2C = 0x00000001  # plain transfers; no SMBus emulation
I2C_M_RD = 0x0001
MOST_MESSAGES, LONGEST_MESSAGE = 42, 8192  # I2C_RDWR_IOCTL_MAX_MSGS; i2c-dev's limit
RDWR = struct.Struct("=QI")  # address of the messages, and their number
MESSAGE = struct.Struct("=HHHxxQ")  # device address, flags, length, address of the bytes

# linux/fuse.h
GETATTR, OPEN, RELEASE, FLUSH, INIT, INTERRUPT, FORGET, BATCH_FORGET, IOCTL = 3, 14, 18, 25, 26, 36, 2, 42, 39
UNANSWERED = frozenset({FORGET, BATCH_FORGET, INTERRUPT})
IN_HEADER, OUT_HEADER = struct.Struct("=IIQQIIII"), struct.Struct("=IiQ")
INIT_IN, INIT_OUT = struct.Struct("=IIII"), struct.Struct("=IIIIHHIIHH32x")
ATTR_OUT = struct.Struct("=QIxxxx6Q10I")
OPEN_OUT = struct.Struct("=QIxxxx")
IOCTL_IN, IOCTL_OUT = struct.Struct("=QIIQII"), struct.Struct("=iIII")
MAJOR, MINOR = 7, 31
DIRECT_IO, NONSEEKABLE = 0x1, 0x4
REQUEST_BYTES = 1 << 17
ROOT = 1
MNT_DETACH = 2
# Errors of opening /dev/fuse or mounting if FUSE or permission is missing; any other error is a defect of this module.
UNAVAILABLE = frozenset({errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.EPERM, errno.EACCES})


class FuseI2C:
    """Serves `bus` at `path` (created if missing) until closed. Use it as a context manager.

    bit_rate_Hz: makes a transfer take as long as on a wire. Raises OSError if FUSE is missing or not permitted
    (UNAVAILABLE).
    """

    def __init__(self, bus: I2CBus, path: str | Path, bit_rate_Hz: float = 400e3):
        self._bus = bus
        self._byte_s = 9 / bit_rate_Hz
        self.path = Path(path)
        self._libc = ctypes.CDLL(None, use_errno=True)
        self._fuse = os.open("/dev/fuse", os.O_RDWR)
        self.path.touch()
        options = f"fd={self._fuse},rootmode={stat.S_IFREG:o},user_id={os.getuid()},group_id={os.getgid()},allow_other"
        try:
            self._call("mount", b"fake-i2c", os.fsencode(self.path), b"fuse", ctypes.c_ulong(0), options.encode())
        except OSError:
            os.close(self._fuse)
            raise
        self._thread = threading.Thread(target=self._serve, name=f"fuse {self.path}", daemon=True)
        self._thread.start()

    def __enter__(self) -> "FuseI2C":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Unmount; a daemon that still has the file open gets errors from then on."""
        if self._fuse >= 0:
            self._call("umount2", os.fsencode(self.path), MNT_DETACH)
            self._thread.join(timeout=1.0)
            os.close(self._fuse)
            self._fuse = -1
            self._thread.join()

    def _call(self, name: str, *arguments: object) -> int:
        result: int = getattr(self._libc, name)(*arguments)
        if result < 0:
            number = ctypes.get_errno()
            raise OSError(number, os.strerror(number), str(self.path))
        return result

    # --- the file system: one file, no name ---

    def _serve(self) -> None:
        while True:
            try:
                request = os.read(self._fuse, REQUEST_BYTES)
            except OSError as error:
                if error.errno in (errno.ENOENT, errno.EINTR, errno.EAGAIN):  # the request was canceled
                    continue
                return  # ENODEV: unmounted
            _, opcode, unique, _, _, _, pid, _ = IN_HEADER.unpack_from(request)
            try:
                body, number = self._answer(opcode, request[IN_HEADER.size :], pid), 0
            except OSError as error:
                body, number = b"", -(error.errno or errno.EIO)
            if opcode not in UNANSWERED:
                try:
                    os.write(self._fuse, OUT_HEADER.pack(OUT_HEADER.size + len(body), number, unique) + body)
                except FileNotFoundError:  # the caller has ended
                    pass
                except OSError:  # closed during a request
                    return

    def _answer(self, opcode: int, body: bytes, pid: int) -> bytes:
        """The reply to a request. Raises OSError with the error number for the caller."""
        if opcode == INIT:
            _, _, read_ahead, _ = INIT_IN.unpack_from(body)
            return INIT_OUT.pack(MAJOR, MINOR, read_ahead, 0, 0, 0, REQUEST_BYTES // 2, 1, 0, 0)
        if opcode == GETATTR:
            size = times = 0
            mode = stat.S_IFREG | 0o666
            return ATTR_OUT.pack(1, 0, ROOT, size, 0, *[times] * 6, mode, 1, 0, 0, 0, 4096, 0)
        if opcode == OPEN:
            return OPEN_OUT.pack(0, DIRECT_IO | NONSEEKABLE)
        if opcode in (RELEASE, FLUSH):
            return b""
        if opcode == IOCTL:
            _, _, command, argument, _, _ = IOCTL_IN.unpack_from(body)
            return IOCTL_OUT.pack(self._ioctl(command, argument, pid), 0, 0, 0)
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))

    # --- i2c-dev ---

    def _ioctl(self, command: int, argument: int, pid: int) -> int:
        """Carry out an ioctl(2), and return its result: the number of messages of a transfer."""
        if command == I2C_FUNCS:
            self._store(pid, argument, I2C_FUNC_I2C.to_bytes(8, "little"))
        elif command == I2C_RDWR:
            return self._transfer(argument, pid)
        elif command not in (I2C_RETRIES, I2C_TIMEOUT, I2C_SLAVE, I2C_SLAVE_FORCE):
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
        return 0

    def _transfer(self, argument: int, pid: int) -> int:
        where, count = RDWR.unpack(self._fetch(pid, argument, RDWR.size))
        if not 0 < count <= MOST_MESSAGES:
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        messages = list(MESSAGE.iter_unpack(self._fetch(pid, where, count * MESSAGE.size)))
        if any(length > LONGEST_MESSAGE for _, _, length, _ in messages):
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        time.sleep(sum(1 + length for _, _, length, _ in messages) * self._byte_s)
        written: tuple[int, bytes] | None = None  # a write that a repeated start may follow
        for address, flags, length, pointer in messages:
            if not flags & I2C_M_RD:
                if written is not None:
                    self._bus.write(*written)
                written = (address, self._fetch(pid, pointer, length))
                continue
            if written is not None and written[0] == address:
                reply = self._bus.write_read(address, written[1], length)
            else:
                if written is not None:
                    self._bus.write(*written)
                reply = self._bus.read(address, length)
            written = None
            self._store(pid, pointer, reply)
        if written is not None:
            self._bus.write(*written)
        return int(count)

    # --- the caller's memory ---

    def _fetch(self, pid: int, pointer: int, length: int) -> bytes:
        data = ctypes.create_string_buffer(length)
        self._move("process_vm_readv", pid, pointer, data, length)
        return data.raw

    def _store(self, pid: int, pointer: int, data: bytes) -> None:
        self._move("process_vm_writev", pid, pointer, ctypes.create_string_buffer(data, len(data)), len(data))

    def _move(self, name: str, pid: int, pointer: int, buffer: "ctypes.Array[ctypes.c_char]", length: int) -> None:
        if length == 0:
            return
        ours = IoVec(ctypes.addressof(buffer), length)
        remote = IoVec(pointer, length)
        unity, flags = ctypes.c_ulong(1), ctypes.c_ulong(0)
        if self._call(name, pid, ctypes.byref(ours), unity, ctypes.byref(remote), unity, flags) != length:
            raise OSError(errno.EFAULT, os.strerror(errno.EFAULT))


class IoVec(ctypes.Structure):
    """struct iovec"""

    _fields_ = (("base", ctypes.c_void_p), ("length", ctypes.c_size_t))
