"""A server for one page: on 127.0.0.1 only, with a token in the address. It ends when the page is closed."""

import asyncio
import json
import re
import secrets
import socket
import struct
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from ...errors import UserError, one_line
from ...report.page.build import filled, head, inert, resource, script_source
from ...typed_json import checked
from .frames import Frames, Wish

HOST = "127.0.0.1"
HOSTS = (HOST, "localhost")
GRACE_S = 2.0  # seconds to wait after the last page has closed: a page that is reloaded connects again within this time
LONGEST_WISH = 4096  # largest message from the page, bytes

TOKEN_NEEDED = "Open the whole address that shadowbench view has printed, with its token.\n"


class Server:
    """The server of a page for ``frames``.

    facts  what the page shows from the beginning: the state that it begins with, and the scene
    """

    def __init__(self, frames: Frames, facts: dict[str, Any], listening: socket.socket):
        self.frames = frames
        self.facts = facts
        self.listening = listening
        self.token = secrets.token_urlsafe(24)
        self.port: int = listening.getsockname()[1]
        self._open = 0
        self._worker = ThreadPoolExecutor(max_workers=1)  # frames are made one after the other
        app = Starlette(
            routes=[Route("/", self._page), WebSocketRoute("/frames", self._frames)],
            middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=list(HOSTS))],
        )
        config = uvicorn.Config(
            app, ws="wsproto", log_level="error", access_log=False, ws_max_size=LONGEST_WISH, lifespan="off",
            timeout_graceful_shutdown=2,
        )  # fmt: skip
        self._uvicorn = uvicorn.Server(config)

    @property
    def address(self) -> str:
        return f"http://{HOST}:{self.port}/?token={self.token}"

    def run(self) -> None:
        """Serve until the page is closed, or the process is interrupted. The first frame is made before a page asks."""
        self._worker.submit(self.answer, json.dumps(self.facts["state"]))
        try:
            self._uvicorn.run(sockets=[self.listening])
        finally:
            self._worker.shutdown(cancel_futures=True)

    def _known(self, given: str | None) -> bool:
        return secrets.compare_digest((given or "").encode(), self.token.encode())

    def _own(self, origin: str | None) -> bool:
        """Whether a connection comes from this server's page, or from a program that is no browser."""
        return origin in (None, *(f"http://{host}:{self.port}" for host in HOSTS))

    async def _page(self, request: Request) -> Response:
        if not self._known(request.query_params.get("token")):
            return PlainTextResponse(TOKEN_NEEDED, 403)
        text = page({**self.facts, "token": self.token})
        headers = {
            "Content-Security-Policy": policy(text, f"ws://{request.headers['host']}"),
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
        }
        return HTMLResponse(text, headers=headers)

    async def _frames(self, socket: WebSocket) -> None:
        if not (self._known(socket.query_params.get("token")) and self._own(socket.headers.get("origin"))):
            await socket.close(1008)  # before it is accepted: the answer is 403
            return
        await socket.accept()
        self._open += 1
        loop = asyncio.get_running_loop()
        try:
            while True:
                message = await socket.receive()
                if message["type"] == "websocket.disconnect":
                    break
                wish = message.get("text") or message.get("bytes") or ""
                await socket.send_bytes(await loop.run_in_executor(self._worker, self.answer, wish))
        except (WebSocketDisconnect, RuntimeError):  # the page was closed, perhaps while a frame was made
            pass
        finally:
            self._open -= 1
            loop.call_later(GRACE_S, self._leave)

    def _leave(self) -> None:
        if not self._open:
            self._uvicorn.should_exit = True

    def answer(self, wish: str | bytes) -> bytes:
        """The reply to a message: the length of the facts, uint32 little-endian, the facts as JSON, the picture.

        A message is the wish of a frame, or "methods": which ones can trace the scene.
        """
        facts: dict[str, Any]
        try:
            asked = json.loads(wish)
            if asked == "methods":
                facts, picture = {"methods": self.frames.methods()}, b""
            else:
                facts, picture = self.frames.show(checked(Wish, asked))
        except (UserError, ValueError, TypeError, KeyError) as error:
            facts, picture = {"error": one_line(error)}, b""
        except Exception as error:  # the failure of one method must not end the page
            facts, picture = {"error": f"{type(error).__name__}: {one_line(error)}"}, b""
        head = json.dumps(facts).encode()
        return struct.pack("<I", len(head)) + head + picture


def page(facts: dict[str, Any]) -> str:
    """The HTML of the page; ``facts`` are what its script begins with."""
    texts = {"FACTS": inert(facts), "PROGRAM": resource("view.js", __package__)}
    return head(facts["title"], resource("view.css", __package__)) + filled(resource("view.html", __package__), texts)


def policy(text: str, sockets: str) -> str:
    """A content security policy: only the page's own script runs, and it connects to this server only."""
    (program,) = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
    return (
        f"default-src 'none'; script-src {script_source(program)}; style-src 'unsafe-inline'; img-src data: blob:; "
        f"connect-src {sockets}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )


def listen(port: int) -> socket.socket:
    """A socket on the loopback address; port 0: any free one. Raises :class:`UserError` if the port is taken."""
    made = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((HOST, port))
        made.listen(16)
    except (OSError, OverflowError) as error:
        made.close()
        reason = getattr(error, "strerror", None) or str(error)
        raise UserError(
            f"--port {port}: cannot listen there ({reason}); choose another, or leave it out for a free one"
        ) from error
    return made
