"""Recordings on their way to a file, to a viewer, or to both."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rerun as rr

from formats.errors import UsageError, printable

PATIENCE = 5.0  # s that a viewer or a disk may take for what it was sent
ROOM = 1 << 20  # bytes that must be free: rerun hangs on a disk that is full


class Streams:
    """One recording to a file and one to a viewer, so that neither waits for the other.

    Args:
        name: of the recording.
        identity: of the recording: one viewer may show several.
        layout: the blueprint.
        path: of an .rrd; None: none.
        address: of a viewer; None: none.

    Raises:
        UsageError: `address` is no address.
    """

    def __init__(
        self, name: str, identity: str, layout: Any, path: Path | None, address: str | None
    ) -> None:
        self._path, self._file, self._live = path, None, None
        try:
            if address is not None:
                self._live = _recording(identity, rr.GrpcSink(address), layout, name)
        except (RuntimeError, ValueError) as error:
            raise UsageError(str(address), str(error).splitlines()[0]) from error
        if path is not None:
            self._file = _recording(identity, rr.FileSink(str(path)), layout, name)

    def send(self, work: Callable[[Any], None]) -> None:
        """Do `work` for each recording.

        Raises:
            OSError: the disk has no room left.
        """
        if self._path is not None:
            space = os.statvfs(self._path.parent) if hasattr(os, "statvfs") else None
            if space is not None and space.f_bavail * space.f_frsize < ROOM:
                raise OSError("no space left on the disk")
        for recording in (self._file, self._live):
            if recording is not None:
                work(recording)

    def close(self) -> str:
        """Wait for all to arrive, and end the file; what became of the viewer, "" if all is well.

        Raises:
            OSError: the file could not be written.
        """
        if self._file is not None:
            try:
                self._file.flush(timeout_sec=PATIENCE)
            except Exception as error:  # rerun's errors share no base of their own
                raise OSError(f"could not be written ({_first_line(error)})") from error
            if not _within(4 * PATIENCE, self._file.disconnect):  # writes the file's footer
                raise OSError("could not be finished")
        if self._live is not None:
            try:
                self._live.flush(timeout_sec=PATIENCE)
            except Exception as error:
                return _first_line(error)
            _within(PATIENCE, self._live.disconnect)
        return ""


def _recording(identity: str, sink: Any, layout: Any, name: str) -> Any:
    recording = rr.RecordingStream("replay", recording_id=identity)
    recording.set_log_time_enabled(False)
    recording.set_log_tick_enabled(False)
    recording.set_sinks(sink, default_blueprint=layout)
    recording.send_recording_name(name)
    return recording


def _first_line(error: Exception) -> str:
    return printable(str(error).splitlines()[0])


def _within(seconds: float, work: Callable[[], object]) -> bool:
    """Whether work was done in time; it goes on behind the scenes where it was not."""
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join(seconds)
    return not thread.is_alive()
