"""Does to a bus what the daemon does, with smbus2 alone, and prints what it saw. Run by test_fake_fuse_i2c.py."""

import fcntl
import json
import sys
import time

from smbus2 import SMBus, i2c_msg

IMU, ALPHA, NOBODY = 0x68, 0x36, 0x50

with SMBus(sys.argv[1]) as bus:
    fcntl.ioctl(bus.fd, 0x0702, 2)  # I2C_TIMEOUT, 20 ms

    def registers(start, count):
        reply = i2c_msg.read(IMU, count)
        bus.i2c_rdwr(i2c_msg.write(IMU, [start]), reply)
        return list(reply)

    bus.i2c_rdwr(i2c_msg.write(IMU, [0x19, 4, 3]))
    frame = i2c_msg.read(ALPHA, 4)
    bus.i2c_rdwr(frame)
    try:
        bus.i2c_rdwr(i2c_msg.read(NOBODY, 1))
        absent = None
    except OSError as error:
        absent = error.errno
    durations = []
    for _ in range(50):
        start_s = time.perf_counter()
        registers(0x3B, 14)
        durations.append(time.perf_counter() - start_s)
    seen = {
        "who_am_i": registers(0x75, 1)[0],
        "kept": registers(0x19, 2),
        "bridge_counts": int.from_bytes(bytes(frame)[:2], "big") & 0x3FFF,
        "absent": absent,
        "longest": len(registers(0x74, 504)),
        "quickest_transfer_s": min(durations),
    }
json.dump(seen, sys.stdout)
