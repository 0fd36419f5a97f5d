"""Starts the Rerun viewer on this machine, for no other machine to reach."""

from __future__ import annotations

import socket
import subprocess
import sys
from pathlib import Path


def free_port() -> int:
    """A port of the loopback interface that nothing listens on."""
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


def start_viewer() -> str:
    """Starts the viewer's own binary, bound to the loopback interface; its address."""
    import rerun_cli

    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    binary = Path(rerun_cli.__file__).parent / name
    port = free_port()
    subprocess.Popen(
        [binary, "--bind", "127.0.0.1", "--port", str(port), "--hide-welcome-screen"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    return f"rerun+http://127.0.0.1:{port}/proxy"
