"""Sends service notifications to systemd (sd_notify(3)): datagrams to $NOTIFY_SOCKET. Does nothing without systemd."""

import os
import socket

READY, ALIVE, STOPPING = "READY=1", "WATCHDOG=1", "STOPPING=1"


def is_service() -> bool:
    """Whether systemd has started this process and waits for its notifications."""
    return bool(os.environ.get("NOTIFY_SOCKET"))


def notify(*states: str) -> None:
    """Send states such as READY or "STATUS=recording". Errors of the socket are ignored."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return
    if address.startswith("@"):
        address = "\0" + address[1:]
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as channel:
            channel.sendto("\n".join(states).encode(), address)
    except OSError:
        return
