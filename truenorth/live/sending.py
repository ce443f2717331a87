"""Lines to a socket: UDP datagrams, or a TCP port at which clients may listen."""

from __future__ import annotations

import selectors
import socket
from collections.abc import Callable
from urllib.parse import urlsplit

from truenorth.core.errors import UsageError

EXAMPLES = "udp://HOST:PORT, or tcp://:PORT at which clients may listen"


def open_sink(text: str) -> Callable[[str], None]:
    """What sends a line to the place that a text names.

    ``udp://HOST:PORT``: a datagram each. ``tcp://:PORT``: every client that is connected gets it; bound to this machine alone
    unless another address is named; a client that does not read is left. Nothing ever waits.

    Raises
    ------
    UsageError
        A text that names none, an address that cannot be had.
    """
    address = urlsplit(text)
    try:
        port = address.port
        if address.scheme == "udp" and port and address.hostname:
            return _udp(address.hostname, port)
        if address.scheme == "tcp" and port:
            return _tcp(address.hostname or "127.0.0.1", port)
    except OSError as error:
        raise UsageError(f"{text}: cannot be opened ({error.strerror or error})") from None
    except ValueError as error:
        raise UsageError(f"{text}: {error}; expected {EXAMPLES}") from None
    raise UsageError(f"{text!r} is no place for lines; expected {EXAMPLES}")


def _udp(host: str, port: int) -> Callable[[str], None]:
    family, kind, protocol, _, there = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    line = socket.socket(family, kind, protocol)
    line.setblocking(False)

    def send(text: str) -> None:
        try:
            line.sendto(text.encode() + b"\n", there)
        except OSError:  # nobody there now, or no room: a datagram may be lost
            return

    return send


def _tcp(host: str, port: int) -> Callable[[str], None]:
    server = socket.create_server((host, port))
    server.setblocking(False)
    clients: list[socket.socket] = []
    knocking = selectors.DefaultSelector()
    knocking.register(server, selectors.EVENT_READ)

    def send(text: str) -> None:
        while knocking.select(0):
            client, _ = server.accept()
            client.setblocking(False)
            clients.append(client)
        data = text.encode() + b"\n"
        for client in list(clients):
            try:
                whole = client.send(data) == len(data)
            except OSError:
                whole = False
            if not whole:
                clients.remove(client)
                client.close()

    return send
