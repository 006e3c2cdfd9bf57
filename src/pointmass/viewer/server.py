"""Hands pages and frames to browsers, on this machine unless told otherwise."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import secrets
import socket
import threading
from collections.abc import Collection
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from pointmass.errors import InvalidInput
from pointmass.viewer.messages import LONGEST, Ack, Inbound, Note, Outbound, decode, encode
from pointmass.viewer.pack import pack, versions
from pointmass.viewer.session import Session
from pointmass.viewer.track import Mark

IN_FLIGHT = 2  # frames that a page has not acknowledged
MOST_PAGES = 32
POLICY = (  # no request leaves the user's machine
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "font-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
NOTEBOOKS = " http://localhost:* http://127.0.0.1:*"  # who else may frame a page that is made for a notebook
REFUSED = 1008  # a web socket's "policy violation"; before it is accepted: 403


class Server:
    """Serves a session's page in a thread of its own.

    Parameters
    ----------
    page : folder of the built page.
    host, port : where to listen; port 0 = any that is free.
    expose : allow a host that others can reach.
    token : by which pages are let in; a new one by default.
    framed : whether a notebook on this machine may hold the page.
    proxied : whether another server hands requests on, under a name of its own that cannot be known here; the token
        guards the page then.
    origins : further addresses whose pages are let in, such as "https://hub.example.org".

    Raises
    ------
    InvalidInput
        A host beyond this machine without `expose`, or an address that is taken.
    """

    def __init__(
        self,
        session: Session,
        page: Path,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        expose: bool = False,
        token: str | None = None,
        framed: bool = False,
        proxied: bool = False,
        origins: Collection[str] = (),
    ) -> None:
        if not expose and not _loops_back(host):
            raise InvalidInput(
                f"host = {host!r} is not allowed: others could reach the page there; add --expose if that is wanted"
            )
        self._session = session
        self.token = token or secrets.token_urlsafe(24)
        self._socket = _listening(host, port)
        self.host, self.port = host, int(self._socket.getsockname()[1])
        self._hosts = {f"{name}:{self.port}" for name in {_shown(host), "127.0.0.1", "localhost", "[::1]"}}
        self._any_name = proxied or (expose and not _loops_back(host))
        self._origins = frozenset(origins)
        self._policy = POLICY + NOTEBOOKS * framed
        self._pages = 0
        app = Starlette(
            routes=[
                Route("/", self._index),
                Route("/scene.toml", self._scene),
                WebSocketRoute("/frames", self._frames),
                Mount("/assets", StaticFiles(directory=page / "assets", check_dir=False)),
            ]
        )
        self._index_file = page / "index.html"
        config = uvicorn.Config(
            _Guard(app, self),
            log_level="warning",
            lifespan="off",
            ws_max_size=4 * LONGEST,
            ws_per_message_deflate=False,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(
            target=self._server.run, kwargs={"sockets": [self._socket]}, name="pointmass server", daemon=True
        )

    @property
    def address(self) -> str:
        """Of the page, with the token."""
        return f"http://{_shown(self.host)}:{self.port}/?token={self.token}"

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def stop(self) -> None:
        """End: pages lose their connection."""
        self._server.should_exit = True
        self._thread.join(timeout=5.0)
        self._socket.close()

    # ------------------------------------------------------------------------------------------------ who may come in

    def allows(self, headers: dict[str, str]) -> bool:
        """Whether a request is for this server, and from one of its own pages if it says where it is from."""
        host, origin = headers.get("host", ""), headers.get("origin")
        if self._any_name:  # known by names that we cannot know; the token guards it
            return origin is None or origin in self._origins or origin in {f"http://{host}", f"https://{host}"}
        own = origin is None or origin in self._origins or origin in {f"http://{name}" for name in self._hosts}
        return host in self._hosts and own

    def _knows(self, token: str | None) -> bool:
        return secrets.compare_digest((token or "").encode(), self.token.encode())

    # ------------------------------------------------------------------------------------------------ what they get

    async def _index(self, request: Request) -> Response:
        if not self._knows(request.query_params.get("token")):
            return PlainTextResponse("open the address that pointmass view printed: it has a token", 403)
        headers = {
            "Content-Security-Policy": self._policy,
            "Referrer-Policy": "no-referrer",
            "Cache-Control": "no-store",
        }
        return FileResponse(self._index_file, headers=headers)

    async def _scene(self, request: Request) -> Response:
        if not self._knows(request.query_params.get("token")):
            return PlainTextResponse("the address needs the token that pointmass view printed", 403)
        try:
            text = await asyncio.to_thread(self._session.text)
        except InvalidInput as error:
            return PlainTextResponse(str(error), 409)
        return PlainTextResponse(text, headers={"Cache-Control": "no-store"})

    async def _frames(self, socket: WebSocket) -> None:
        from_page = socket.headers.get("origin") is not None  # all browsers say so
        if not from_page or not self._knows(socket.query_params.get("token")) or self._pages >= MOST_PAGES:
            await socket.close(REFUSED)
            return
        await socket.accept()
        self._pages += 1
        try:
            await _Page(socket, self._session).serve()
        finally:
            self._pages -= 1


class _Guard:
    """Refuses, with 403, requests to other hosts and from other pages: before anything looks at them."""

    def __init__(self, app: Any, server: Server) -> None:
        self._app, self._server = app, server

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope.get("headers", ())}
        if self._server.allows(headers):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": REFUSED})
        else:
            await PlainTextResponse("this page is not for you", 403)(scope, receive, send)


class _Page:
    """One browser's page: the newest frame, at most so many on their way, and never a queue."""

    def __init__(self, socket: WebSocket, session: Session) -> None:
        self._socket, self._session = socket, session
        self._loop = asyncio.get_running_loop()
        self._news = asyncio.Event()
        self._messages: dict[str, Outbound] = {}  # the newest of each kind
        self._known: dict[str, int] = {}
        self._run = 0  # that they are of
        self._marks: dict[str, Mark] = {}  # of tracks: what it has got
        self._sent = self._acknowledged = 0  # frames
        self._newest = 0  # sequence of the last one sent

    async def serve(self) -> None:
        """Until the page leaves."""
        leave = self._session.watch(self._woken)
        for message in self._session.greeting():
            self._messages[message.kind] = message
        self._news.set()
        tasks = [asyncio.create_task(self._receive()), asyncio.create_task(self._send())]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            leave()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    def _woken(self, message: Outbound | None) -> None:
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._heard, message)

    def _heard(self, message: Outbound | None) -> None:
        if message is not None:
            self._messages[message.kind] = message
        self._news.set()

    async def _receive(self) -> None:
        with contextlib.suppress(WebSocketDisconnect):
            while True:
                event = await self._socket.receive()
                if event["type"] == "websocket.disconnect":
                    return
                try:
                    self._take(decode(event.get("text") or event.get("bytes") or ""))
                except InvalidInput as error:
                    self._heard(Note(level="error", text=str(error)))

    def _take(self, message: Inbound) -> None:
        if isinstance(message, Ack):
            self._acknowledged = min(self._acknowledged + 1, self._sent)
            self._news.set()
        else:
            self._session.send(message)

    async def _send(self) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):  # it left meanwhile
            while True:
                await self._news.wait()
                self._news.clear()
                while self._messages:
                    message = self._messages.pop(next(iter(self._messages)))
                    await self._socket.send_text(encode(message))
                await self._send_frame()

    async def _send_frame(self) -> None:
        shown = self._session.latest
        if shown is None or shown.sequence <= self._newest or self._sent - self._acknowledged >= IN_FLIGHT:
            return
        if shown.run != self._run:
            self._run, self._known = shown.run, {}
        readings = shown.readings
        tracks = [track.since(self._marks.get(track.name)) for track in readings.tracks]
        data = await asyncio.to_thread(
            pack,
            shown.frame,
            shown.sequence,
            self._known,
            cost=shown.cost,
            held=shown.held,
            target=shown.target,
            picked=shown.picked,
            pinned=shown.pinned,
            tracks=tracks,
            legend=readings.legend,
            inspected=readings.inspected,
            duel=readings.duel,
            curves=readings.curves,
        )
        self._marks |= {rows.name: rows.mark for rows in tracks}
        self._known, self._newest = versions(shown.frame), shown.sequence
        self._sent += 1
        await self._socket.send_bytes(data)


def _listening(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except (OSError, OverflowError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InvalidInput(f"cannot listen at {host}, port {port}: {reason}; give another --port") from None


def _loops_back(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _shown(host: str) -> str:
    return f"[{host}]" if ":" in host else host
