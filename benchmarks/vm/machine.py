"""Controls the virtual machine: QEMU without hardware acceleration, its console, serial lines and power."""

import json
import re
import socket
import subprocess
import threading
import time
from pathlib import Path
from typing import Any, NamedTuple

from parts import parts_at_rest

from flightpower.hw_fakes.tray import PORTS

SHIFT = 1  # an instruction takes 2^SHIFT ns of the machine's time, however busy the host is
HEARTBEAT_S = 0.05  # guest/fake_tray.py
MEMORY_MB = 512  # memory of a Pi Zero 2 W
USB = {"gps": 38400, "rpm": 115200}  # serial number and baud rate of each adapter
SERIAL = {"autopilot": 57600}  # /dev/ttyS2
DEVICES = {"gps": PORTS["gps"], "rpm": PORTS["esc_counter"], "autopilot": PORTS["autopilot"]}
PROMPT = r"pi@raspberrypi:~\$ "
POLL_S = 0.005


class Heartbeat(NamedTuple):
    """guest_s: monotonic time of the virtual machine. logs: number of logs. size: size of the newest log [bytes]"""

    guest_s: float
    logs: int
    size: int


class Machine:
    """A running virtual machine with the parts at the other end of its serial lines. Use it as a context manager.

    folder: has vmlinuz and initrd; the console's text is kept there. disk: the card. It is in write-back mode: a write
    that the machine believes done is in the host's memory and survives the end of QEMU, as on a card without a cache.
    """

    def __init__(self, folder: Path, disk: Path):
        self._folder = folder / "run"
        self._folder.mkdir(exist_ok=True)
        names = ("console", "heartbeat", "qmp", *USB, *SERIAL)
        for name in names:
            (self._folder / name).unlink(missing_ok=True)
        command = [
            "qemu-system-x86_64", "-accel", "tcg,thread=single", "-icount", f"shift={SHIFT},sleep=on",
            "-rtc", "clock=vm", "-cpu", "max", "-smp", "1", "-m", str(MEMORY_MB),
            "-display", "none", "-no-reboot", "-nic", "none",
            "-kernel", folder / "vmlinuz", "-initrd", folder / "initrd",
            "-append", "root=LABEL=rootfs rw console=ttyS0 quiet loglevel=2 systemd.show_status=0 mitigations=off",
            "-drive", f"file={disk},format=raw,if=virtio,cache=writeback",
            "-qmp", f"unix:{self._folder}/qmp,server=on,wait=off", "-device", "qemu-xhci",
        ]  # fmt: skip
        for name in names:
            if name != "qmp":
                command += ["-chardev", f"socket,id={name},path={self._folder}/{name},server=on,wait=off"]
        for name in ("console", "heartbeat", *SERIAL):
            command += ["-serial", f"chardev:{name}"]
        for name in USB:
            command += ["-device", json.dumps(_adapter(name))]
        with (self._folder / "qemu.txt").open("w") as output:
            self._process = subprocess.Popen([str(part) for part in command], stdout=output, stderr=output)
        self.started_s = time.monotonic()
        self._stop = threading.Event()
        self._console = self._connect("console")
        self._console.settimeout(0.2)
        self._transcript = (self._folder / "console.txt").open("a")
        self._text = ""
        self._commands = 0
        self.heartbeat = Heartbeat(0.0, 0, 0)
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()
        tray = parts_at_rest()
        for name, baud in {**USB, **SERIAL}.items():
            threading.Thread(target=self._serve, args=(name, tray.port(DEVICES[name], baud)), daemon=True).start()

    def __enter__(self) -> "Machine":
        return self

    def __exit__(self, *exception: object) -> None:
        self.pull_power()
        self._transcript.close()

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    def pull_power(self) -> float:
        """End the machine at once. Returns its monotonic time at that moment [s], at most one heartbeat too late."""
        if self.running:
            self._process.kill()
        self._process.wait()
        self._listener.join(10.0)
        self._stop.set()
        return self.heartbeat.guest_s + HEARTBEAT_S

    def switch_off(self) -> None:
        self._console.sendall(b"sudo systemctl poweroff\n")
        self._process.wait(120)

    def log_in(self, timeout_s: float = 600.0) -> None:
        """Wait for the console's shell, and set it up."""
        self._wait(PROMPT, timeout_s)
        self._console.sendall(b"stty -echo cols 500; PS1=; PS2=; export SYSTEMD_PAGER=cat SYSTEMD_COLORS=0 TERM=dumb\n")
        for _ in range(2):
            self.run("true")

    def run(self, command: str, timeout_s: float = 600.0) -> tuple[int, str]:
        """Run a command as user pi. Returns its exit code and output."""
        self._commands += 1
        mark = f"end-of-command-{self._commands}:"
        # Send one compound command, because sudo would read further lines that wait in this terminal.
        self._console.sendall(f"{{ {command}\n}} </dev/null; code=$?; echo; echo '{mark}'$code\n".encode())
        match = self._wait(rf"(?s)(.*?)\r?\n{mark}(\d+)\r?\n", timeout_s)
        return int(match[2]), match[1].replace("\r", "").strip("\n")

    def wait_for_recording(self, logs: int, timeout_s: float = 600.0) -> None:
        """Wait until there are more than `logs` logs, and data in the newest one."""
        end_s = time.monotonic() + timeout_s
        while self.heartbeat.logs <= logs or self.heartbeat.size < 20_000:
            if time.monotonic() > end_s or not self.running:
                raise TimeoutError(f"no new log after {timeout_s:.0f} s; see {self._folder / 'console.txt'}")
            self._read()
            time.sleep(0.1)

    def wait(self, seconds: float) -> None:
        """Wait until this much of the machine's time has passed."""
        end_s, give_up_s = self.heartbeat.guest_s + seconds, time.monotonic() + 300.0 + 60.0 * seconds
        while self.heartbeat.guest_s < end_s:
            if time.monotonic() > give_up_s or not self.running:
                raise TimeoutError(f"the heartbeat stopped at {self.heartbeat.guest_s:.1f} s")
            self._read()

    def unplug(self, adapter: str) -> None:
        self._qmp("device_del", id=f"usb-{adapter}")

    def plug(self, adapter: str) -> None:
        self._qmp("device_add", **_adapter(adapter))

    def _qmp(self, command: str, **arguments: Any) -> None:
        with self._connect("qmp") as connection, connection.makefile("rw") as stream:
            stream.readline()
            for request in ({"execute": "qmp_capabilities"}, {"execute": command, "arguments": arguments}):
                stream.write(json.dumps(request) + "\n")
                stream.flush()
                reply = json.loads(stream.readline())
                while "event" in reply:
                    reply = json.loads(stream.readline())
                assert "return" in reply, reply

    def _connect(self, name: str) -> socket.socket:
        for _ in range(100):
            connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            try:
                connection.connect(str(self._folder / name))
                return connection
            except OSError:
                connection.close()
                time.sleep(0.1)
        raise RuntimeError(f"QEMU did not start: {(self._folder / 'qemu.txt').read_text()[-500:]}")

    def _read(self) -> None:
        try:
            text = self._console.recv(65536).decode("utf-8", "replace")
        except TimeoutError:
            return
        self._text += text
        self._transcript.write(text)
        self._transcript.flush()

    def _wait(self, pattern: str, timeout_s: float) -> re.Match[str]:
        end_s = time.monotonic() + timeout_s
        while (match := re.search(pattern, self._text)) is None:
            if time.monotonic() > end_s or not self.running:
                raise TimeoutError(f"the console did not show {pattern!r} but {self._text[-300:]!r}")
            self._read()
        self._text = self._text[match.end() :]
        return match

    def _listen(self) -> None:
        """Read the heartbeat until the machine ends."""
        rest = ""
        with self._connect("heartbeat") as line:
            while data := line.recv(4096):
                *lines, rest = (rest + data.decode("ascii", "replace")).split("\n")
                for text in lines:
                    if match := re.fullmatch(r"(\d+\.\d+) (\d+) (\d+)\r?", text):
                        self.heartbeat = Heartbeat(float(match[1]), int(match[2]), int(match[3]))

    def _serve(self, name: str, part: Any) -> None:
        with self._connect(name) as line:
            line.setblocking(False)
            while not self._stop.is_set():
                time.sleep(POLL_S)
                try:
                    if data := line.recv(4096):
                        part.write(data)
                except BlockingIOError:
                    pass
                except OSError:
                    return
                try:
                    line.send(part.read_available())
                except BlockingIOError:  # nobody reads the line
                    pass
                except OSError:
                    return


def _adapter(name: str) -> dict[str, Any]:
    """Return QEMU's options for a USB serial adapter (FTDI), whose serial number is its name."""
    return {"driver": "usb-serial", "chardev": name, "id": f"usb-{name}", "serial": name, "always-plugged": True}
