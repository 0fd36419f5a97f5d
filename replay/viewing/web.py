"""The web viewer for browsers of this machine, kept from calling anybody else.

Rerun's page asks for fonts, for news of releases, and sends usage statistics. It is passed on
under a policy that lets a browser connect to this machine alone.
"""

from __future__ import annotations

import subprocess
import threading
from collections.abc import Sequence
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from replay.viewing.process import await_port, free_port, start

ANY = "'self' 'unsafe-inline' 'unsafe-eval' data: blob:"
PASSED_ON = ("Content-Type", "Content-Encoding", "Cache-Control", "ETag")
PATIENCE = 30.0  # s for the viewer's files


class Web(NamedTuple):
    """A web viewer that is served.

    Attributes:
        page: to open in a browser.
        address: to send recordings to.
        process: of the viewer behind it.
        server: that passes its pages on.
    """

    page: str
    address: str
    process: subprocess.Popen[bytes]
    server: ThreadingHTTPServer

    def close(self) -> None:
        """Serve no more."""
        self.server.shutdown()
        self.server.server_close()
        self.process.kill()
        self.process.wait()


def serve_web(recordings: Sequence[Path] = ()) -> Web:
    """Serves the viewer, with recordings in it, as long as this process lives.

    Raises:
        FormatError: it does not start.
    """
    port, behind = free_port(), free_port()
    ports = "--port", str(port), "--web-viewer-port", str(behind)
    process = start("--serve-web", *ports, *(str(path.resolve()) for path in recordings))
    for listening in (port, behind):
        await_port(listening, process)
    address = f"rerun+http://127.0.0.1:{port}/proxy"
    server = ThreadingHTTPServer(("127.0.0.1", 0), _passing_on(behind, port))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    page = f"http://127.0.0.1:{server.server_address[1]}/?url={quote(address, safe='')}"
    return Web(page, address, process, server)


def _passing_on(behind: int, port: int) -> type[BaseHTTPRequestHandler]:
    policy = f"default-src {ANY}; connect-src {ANY} http://127.0.0.1:{port}"

    class Passing(BaseHTTPRequestHandler):
        """GET and HEAD, from the server behind, with the policy."""

        def do_GET(self) -> None:
            connection = HTTPConnection("127.0.0.1", behind, timeout=PATIENCE)
            try:
                connection.request(self.command, self.path)
                answer = connection.getresponse()
                data = answer.read()
            except (OSError, HTTPException):
                self.send_error(502)
                return
            finally:
                connection.close()
            self.send_response(answer.status)
            for name in PASSED_ON:
                if value := answer.getheader(name):
                    self.send_header(name, value)
            self.send_header("Content-Security-Policy", policy)
            self.send_header("Content-Length", str(len(data)))
            self.end_headers()
            if self.command == "GET":
                self.wfile.write(data)

        do_HEAD = do_GET  # noqa: N815

        def log_message(self, format: str, *args: object) -> None:
            """Requests of a browser are nobody's business."""

    return Passing
