"""An HTTP server for the tests: counts requests, serves ranges, and misbehaves as it is told."""

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any


@dataclass
class Behaviour:
    """What the server does.

    Args:
        files: path -> content.
        ranges: whether it serves parts.
        status: path -> status that it answers with instead.
        moved: path -> path that it redirects to.
        claims: path -> size that HEAD states instead of the true one.
        dies_after: GET requests that are answered wholly; later ones break off in the middle.
        requests: "METHOD path" of every request so far.
    """

    files: dict[str, bytes]
    ranges: bool = True
    status: dict[str, int] = field(default_factory=dict)
    moved: dict[str, str] = field(default_factory=dict)
    claims: dict[str, int] = field(default_factory=dict)
    dies_after: int | None = None
    requests: list[str] = field(default_factory=list)
    authorization: list[str | None] = field(default_factory=list)

    @property
    def gets(self) -> int:
        return sum(request.startswith("GET") for request in self.requests)


@contextmanager
def serving(behaviour: Behaviour) -> Iterator[str]:
    """The address of a server with `behaviour`, without a slash at its end."""

    class Handler(_Handler):
        does = behaviour

    server = _Server(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that hangs up is no news."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    does: Behaviour

    def do_HEAD(self) -> None:
        self._answer(body=False)

    def do_GET(self) -> None:
        self._answer(body=True)

    def log_message(self, *args: Any) -> None:
        pass

    def _answer(self, *, body: bool) -> None:
        does, path = self.does, self.path.split("?")[0]
        does.requests.append(f"{self.command} {path}")
        does.authorization.append(self.headers.get("Authorization"))
        if path in does.moved:
            self._head(302, 0, Location=does.moved[path])
        elif path in does.status or path not in does.files:
            self._head(does.status.get(path, 404), 0)
        else:
            self._content(path, does.files[path], body=body)

    def _content(self, path: str, data: bytes, *, body: bool) -> None:
        asked = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        if not body:
            kind = {"Content-Type": "text/html"} if path.endswith("/") else {}
            self._head(200, self.does.claims.get(path, len(data)), ETag=f'"{hash(data)}"', **kind)
        elif asked and self.does.ranges:
            first, last = int(asked[1]), min(int(asked[2]), len(data) - 1)
            if first > last:
                self._head(416, 0)
                return
            self._head(206, last + 1 - first, **{"Content-Range": f"bytes {first}-{last}/{len(data)}"})
            self._write(data[first : last + 1])
        else:
            self._head(200, len(data), **{"Content-Type": "text/html"})
            self._write(data)

    def _head(self, status: int, length: int, **headers: str) -> None:
        self.send_response(status)
        self.send_header("Content-Length", str(length))
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()

    def _write(self, data: bytes) -> None:
        dies = self.does.dies_after is not None and self.does.gets > self.does.dies_after
        try:
            self.wfile.write(data[: len(data) // 2] if dies else data)
        except ConnectionError:
            dies = True
        if dies:
            self.close_connection = True
