"""Pictures of the viewer without a screen."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from rerun.experimental import ViewerClient

from formats.errors import FormatError
from replay.viewing.process import start_unseen

SETTLE = 2.0  # s for the viewer to draw what it was told
PATIENCE = 60.0  # s for a large recording to be there
TIMELINE = "log_time_s"


def screenshot(recording: Path, picture: Path, at_s: float | None = None) -> list[str]:
    """What the viewer shows of a recording, as PNG.

    Args:
        recording: an .rrd.
        picture: is written.
        at_s: the moment, s since the run's start; None: the end.

    Returns:
        what the views and the viewer complain of.

    Raises:
        FormatError: the viewer could not start, as without a Vulkan driver, or shows nothing.
    """
    address, process = start_unseen()
    try:
        viewer = ViewerClient.connect(address)
        viewer.open(f"file://{recording.resolve()}")
        start, end = _span(viewer, recording)
        moment = end if at_s is None else min(max(at_s, start), end)
        viewer.set_time(TIMELINE, duration=moment, play_state="paused")
        time.sleep(SETTLE)
        viewer.save_screenshot(str(picture.resolve()))
        views = viewer.get_state().views
        said = [f"{view.name}: {view.reports}" for view in views if view.reports]
        return said + [log.message for log in viewer.get_logs() if log.level.lower() == "error"]
    except (ConnectionError, RuntimeError, TimeoutError) as error:
        reason = str(error).splitlines()[0]
        raise FormatError(picture, f"the viewer gave no picture ({reason})") from error
    finally:
        process.kill()
        process.wait()


def _span(viewer: Any, recording: Path) -> tuple[float, float]:
    """First and last moment (s) of the recording, as soon as it has stopped growing."""
    before, end = None, time.monotonic() + PATIENCE
    while time.monotonic() < end:
        time.sleep(SETTLE / 4)
        state = viewer.get_state()
        spans = [
            (line.start, line.end)
            for one in state.recordings
            for line in one.timelines
            if line.name == TIMELINE and line.end is not None
        ]
        if spans and spans == before and not state.loading:
            return min(a for a, _ in spans) / 1e9, max(b for _, b in spans) / 1e9
        before = spans
    raise FormatError(recording, f"not a recording of ours: it has no timeline {TIMELINE}")
