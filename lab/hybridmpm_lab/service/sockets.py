"""Viewers of plain sockets, which read bytes and note when frames end: no library adds waits."""

import base64
import json
import secrets
import selectors
import socket
import time
from collections.abc import Sequence

from hybridmpm.client import Client
from hybridmpm.errors import SimulationError
from hybridmpm_lab.harness.rows import Row
from hybridmpm_lab.service.server import Server
from hybridmpm_lab.service.viewers import WAIT

_BINARY, _CLOSE, _PING, _TEXT, _PONG = 2, 8, 9, 1, 10  # opcodes of RFC 6455
_BLOCK = 1 << 16


def arrivals(server: Server, bodies: Sequence[Row], speed: float, seconds: float) -> list[list[float]]:
    """Return when frames of sessions came to a viewer of each [s], after a warm-up of a second.

    Parameters
    ----------
    server : Server
    bodies : sequence of dict
        Arguments of `Client.create` for each session.
    speed : float
        Simulated seconds per second.
    seconds : float
        Length of the measurement [s].

    Raises
    ------
    SimulationError
        The service closed a stream, or sent nothing for a minute.
    """
    with Client(server.address, timeout=WAIT) as client, selectors.DefaultSelector() as ready:
        sessions = [client.create(**body) for body in bodies]
        streams = [_Stream(server.port, session.id) for session in sessions]
        for stream in streams:
            stream.send("speed", value=speed)
            stream.send("play")
            ready.register(stream.socket, selectors.EVENT_READ, stream)
        start = time.perf_counter() + 1.0
        while time.perf_counter() < start + seconds or any(len(stream.ends) < 2 for stream in streams):
            chosen = ready.select(WAIT)
            if not chosen:
                raise SimulationError(f"the service sent nothing within {WAIT:g} s")
            for key, _ in chosen:
                key.data.read(start)
        for stream, session in zip(streams, sessions, strict=True):
            stream.socket.close()
            session.delete()
    return [stream.ends for stream in streams]


class _Stream:
    """A stream of a session."""

    def __init__(self, port: int, session: str) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=WAIT)
        self.ends: list[float] = []
        """Times at which frames had come [s]."""
        key = base64.b64encode(secrets.token_bytes(16)).decode()
        path = f"/v1/sessions/{session}/stream?version=2"
        upgrade = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13"
        lines = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n{upgrade}\r\nSec-WebSocket-Key: {key}\r\n\r\n"
        self.socket.sendall(lines.encode())
        self._held = b""
        while b"\r\n\r\n" not in self._held:
            self._receive()
        head, _, self._held = self._held.partition(b"\r\n\r\n")
        if b" 101 " not in head.splitlines()[0]:
            raise SimulationError(f"the service refused a stream: {head.decode(errors='replace')}")

    def send(self, kind: str, **values: float) -> None:
        """Send a command of the player."""
        self._write(_TEXT, json.dumps({"type": kind} | values).encode())

    def read(self, start: float) -> None:
        """Receive bytes, and note each frame that ends with them, from a time on [s]."""
        self._receive()
        now = time.perf_counter()
        while (message := self._message()) is not None:
            opcode, payload = message
            if opcode == _BINARY and now >= start:
                self.ends.append(now)
            elif opcode == _PING:
                self._write(_PONG, payload)
            elif opcode == _CLOSE:
                raise SimulationError(f"the service closed a stream: {payload[2:].decode(errors='replace')}")

    def _receive(self) -> None:
        block = self.socket.recv(_BLOCK)
        if not block:
            raise SimulationError("the service closed a stream")
        self._held += block

    def _message(self) -> tuple[int, bytes] | None:
        """Take the next message from the bytes held; None where it is not whole yet."""
        if len(self._held) < 2:
            return None
        size, begin = self._held[1] & 127, 2
        if size > 125:
            begin += 2 if size == 126 else 8
            size = int.from_bytes(self._held[2:begin], "big")
        if len(self._held) < begin + size:
            return None
        opcode, payload = self._held[0] & 15, self._held[begin : begin + size]
        self._held = self._held[begin + size :]
        return opcode, payload

    def _write(self, opcode: int, payload: bytes) -> None:
        """Send a short message, masked by zeros."""
        self.socket.sendall(bytes([128 | opcode, 128 | len(payload), 0, 0, 0, 0]) + payload)
