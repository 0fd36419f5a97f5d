"""Starts the Rerun viewer on this machine, for no other machine to reach."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from formats.errors import FormatError

PATIENCE = 20.0  # s for a viewer to answer


def free_port() -> int:
    """A port of the loopback interface that nothing listens on."""
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


def binary() -> Path:
    """The viewer itself: `rerun` on PATH is a wrapper whose end leaves it behind."""
    import rerun_cli

    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    return Path(rerun_cli.__file__).parent / name


def start_viewer(recordings: Sequence[Path] = ()) -> str:
    """Starts the viewer in a window of its own, with recordings in it; its address.

    Raises:
        FormatError: there is no screen.
    """
    if sys.platform == "linux" and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        hint = "give --web, --screenshot or --rrd (of run: --rrd)"
        raise FormatError("", "there is no screen for the viewer's window", hint=hint)
    port = free_port()
    start("--port", str(port), "--hide-welcome-screen", *(str(path) for path in recordings))
    return f"rerun+http://127.0.0.1:{port}/proxy"


def start_unseen() -> tuple[str, subprocess.Popen[bytes]]:
    """Starts a viewer that draws without a screen; its address, and its process.

    Raises:
        FormatError: it does not start, as without a Vulkan driver.
    """
    port = free_port()
    process = start("--headless", "--port", str(port), "--hide-welcome-screen")
    await_port(port, process)
    return f"rerun+http://127.0.0.1:{port}/proxy", process


def start(*words: str) -> subprocess.Popen[bytes]:
    """Starts the viewer's binary with some words, on the loopback interface."""
    return subprocess.Popen(
        [binary(), "--bind", "127.0.0.1", *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        env={**os.environ, "RERUN_ANALYTICS": "off"},
    )


def await_port(port: int, process: subprocess.Popen[bytes]) -> None:
    """Until something listens on a port.

    Raises:
        FormatError: the process ends, or nothing does in time.
    """
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end and process.poll() is None:
        with socket.socket() as s:
            if s.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    process.kill()
    hint = "without a screen it needs a Vulkan driver (Debian: mesa-vulkan-drivers libvulkan1)"
    raise FormatError("", "the viewer did not start", hint=hint)
