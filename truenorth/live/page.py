"""A page in the browser while a log runs: heading and its band over time, compass, level, verdict, time that is left, the track.

The page holds all it needs; nothing is fetched from elsewhere. It is bound to this machine alone unless another address is named,
and answers no page of another origin. One thing can be asked for from it, navigation, by a token that stands in the page alone.
"""

from __future__ import annotations

import asyncio
import json
import secrets
import socket
import threading
import time as clock
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable
from importlib import resources
from typing import Any

import numpy as np

from truenorth.core.errors import UsageError
from truenorth.live.aligner import Aligner
from truenorth.live.answer import Answer
from truenorth.live.innovations import newest_innovations
from truenorth.live.navigator import Navigator
from truenorth.live.outputs import waiting
from truenorth.live.spectrum import motion_spectrum

HISTORY = 3600  # answers that a page which is opened late still sees
BEAT = 15.0  # s between two signs of life to a silent page
LONG_SINCE = 1e6  # s: a clock that has run for longer was not started for this log
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; connect-src 'self'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


class Page:
    """A small web server in a thread of its own; make it by :func:`serve`.

    Attributes
    ----------
    address : str
        For the browser.
    """

    def __init__(self, host: str, port: int, goal: float, go: threading.Event | None) -> None:
        self._goal, self._go, self._token = goal, go, secrets.token_urlsafe(16)
        self._run = secrets.token_hex(4)  # a page of an earlier run loads itself anew
        self._events: deque[tuple[int, str]] = deque(maxlen=HISTORY)
        self._number = 0
        self._closing = False
        self._zero: float | None = None
        self._socket = socket.create_server((host, port))
        port = self._socket.getsockname()[1]
        self._hosts = {f"{host}:{port}", f"localhost:{port}", f"127.0.0.1:{port}"}
        self.address = f"http://{host}:{port}/"
        self._server = self._make_server()
        self._thread = threading.Thread(target=self._server.run, args=([self._socket],), daemon=True)
        self._thread.start()

    def publish(self, aligner: Aligner | Navigator, answer: Answer | None, note: str) -> None:
        """Show an answer; a listener of :class:`truenorth.live.session.Session`."""
        self._number += 1
        event: dict[str, Any] = {"run": self._run, "number": self._number, "note": note}
        event["rows"] = aligner.intake.counts.taken
        event["log_s"], event["rate_hz"] = aligner.duration, aligner.log.rate
        event["left_out"] = aligner.intake.counts.words()
        event["may_go"] = self._go is not None and not self._go.is_set() and isinstance(aligner, Aligner)
        if answer is None:
            event["waiting"] = f"the first answer comes after {aligner.first_answer:g} s of log"
            event["note"] = "; ".join(filter(None, (note, aligner.failure)))
        else:
            whole = self._zero is None or self._number % 5 == 1
            event |= answer.summary() | {
                "waiting": waiting(answer, self._goal),
                "goal_deg": float(np.degrees(self._goal)),
                "zero_s": self._zero_of(answer.time - aligner.duration),
            }
            if whole:
                event["spectrum"] = motion_spectrum(aligner.log)
                solution = answer.solution if isinstance(aligner, Aligner) else None
                event["innovations"] = newest_innovations(solution, aligner.residuals)
        self._events.append((self._number, json.dumps(event, allow_nan=False)))

    def _zero_of(self, start: float) -> float:
        """Time that the charts count from, s: the clock's own zero, but for stamps that count from 1970 or 1980."""
        if self._zero is None:
            self._zero = start if abs(start) > LONG_SINCE else 0.0
        return self._zero

    def close(self) -> None:
        """Say that the run has ended, and end the server."""
        self._number += 1
        self._events.append((self._number, json.dumps({"run": self._run, "number": self._number, "ended": True})))
        self._closing = True
        self._server.should_exit = True
        self._thread.join(timeout=5.0)

    def _make_server(self) -> Any:
        try:
            import uvicorn
            from starlette.applications import Starlette
            from starlette.responses import HTMLResponse, Response, StreamingResponse
            from starlette.routing import Route
        except ImportError:
            raise UsageError("a page needs Starlette and uvicorn: pip install 'truenorth[live]'") from None
        text = (resources.files("truenorth.live") / "page.html").read_text(encoding="utf-8")
        text = text.replace("TOKEN", self._token).replace("THIS_RUN", self._run)

        def refused(request: Any) -> bool:
            """A page of another origin, or a name that some other server gave this address."""
            origin = request.headers.get("origin")
            there = request.headers.get("host", "")
            return there not in self._hosts or (origin is not None and origin.split("//")[-1] not in self._hosts)

        async def home(request: Any) -> Any:
            return Response(status_code=403) if refused(request) else HTMLResponse(text, headers=HEADERS)

        async def go(request: Any) -> Any:
            given = request.headers.get("x-token", "")
            if refused(request) or self._go is None or not secrets.compare_digest(given, self._token):
                return Response(status_code=403)
            self._go.set()
            return Response(status_code=204)

        async def events(request: Any) -> Any:
            if refused(request):
                return Response(status_code=403)
            run, _, number = request.headers.get("last-event-id", "").partition("-")
            seen = int(number) if run == self._run and number.isdigit() else 0
            stream = self._stream(seen, request.is_disconnected)
            return StreamingResponse(stream, media_type="text/event-stream", headers=HEADERS)

        application = Starlette(routes=[Route("/", home), Route("/events", events), Route("/go", go, methods=["POST"])])
        return uvicorn.Server(uvicorn.Config(application, log_level="error", lifespan="off", access_log=False))

    async def _stream(self, seen: int, gone: Callable[[], Awaitable[bool]]) -> AsyncIterator[str]:
        """Server-sent events: those of the past that the page has not seen, then each as it comes."""
        spoken = clock.monotonic()
        yield "retry: 1000\n\n"
        closing = False
        while not (closing or await gone()):
            closing = self._closing  # what was said before that is sent
            new = [(number, text) for number, text in list(self._events) if number > seen]
            for number, text in new:
                yield f"id: {self._run}-{number}\ndata: {text}\n\n"
                seen = number
            if new:
                spoken = clock.monotonic()
            elif clock.monotonic() - spoken > BEAT:
                yield ": still here\n\n"
                spoken = clock.monotonic()
            if not closing:
                await asyncio.sleep(0.2)


def serve(address: str, goal: float, go: threading.Event | None = None) -> Page:
    """Start the page.

    Parameters
    ----------
    address : str
        ``:8080`` is this machine alone; ``0.0.0.0:8080`` all of its addresses. Port 0 takes a free one.
    goal : float, rad
        One-sigma of heading that is wished.
    go : threading.Event, optional
        Set when the page asks for navigation; None: it cannot.

    Raises
    ------
    UsageError
        An address that cannot be had, or the extra is not installed.
    """
    host, _, port = address.rpartition(":")
    if not port.isdigit() or int(port) > 65535:
        raise UsageError(f"page address {address!r}; expected :8080 or HOST:8080")
    try:
        return Page(host or "127.0.0.1", int(port), goal, go)
    except OSError as error:
        raise UsageError(f"page address {address}: {error.strerror or error}") from None
