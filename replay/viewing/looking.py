"""view(): results and recordings, in a window, a browser, a picture or a file."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path

from formats.errors import FormatError, Notes, UsageError
from formats.errors import Path as AnyPath
from formats.output import atomic, check_output, check_room
from formats.results.file import RunFile, read_result
from replay.pictures import RUN_COLOURS
from replay.surveying.deviating import of_run
from replay.viewing.drawing import Drawing
from replay.viewing.making import events, scene_of_file, walls_of
from replay.viewing.panels import blueprint
from replay.viewing.process import start_viewer
from replay.viewing.scene import BUDGET, Block, Scene
from replay.viewing.streams import Streams
from replay.viewing.web import Web, serve_web

MOST_RUNS = 6  # side by side; more columns cannot be read
MAGIC = b"RRF"  # of a recording: RRF2 and its like
LEAST = 1 << 23  # bytes free, below which a recording is not begun
SUFFIX = ".replay.mcap"


def view(
    sources: AnyPath | Sequence[AnyPath],
    *,
    rrd: AnyPath | None = None,
    screenshot: AnyPath | None = None,
    at: float | None = None,
    web: bool = False,
    connect: str | None = None,
    viewer_budget: float = BUDGET,
    force: bool = False,
    notes: Notes | None = None,
    say: Callable[[str], object] = print,
    hold: Callable[[Web], object] | None = None,
) -> list[Path]:
    """Look at results, without their logs, or at recordings.

    Args:
        sources: result files, folders that hold some, or .rrd recordings. Several results lie side
            by side on one timeline.
        rrd: write a recording; no window opens then.
        screenshot: write a PNG of what the viewer shows, without a screen; likewise.
        at: of the screenshot, s since the run's start; None: the end.
        web: serve the viewer for browsers of this machine, until interrupted.
        connect: the address of a viewer that is already there.
        viewer_budget: MB that are drawn of each run, about.
        force: replace existing files.
        notes: takes what was odd.
        say: is told where the web viewer is, and when a viewer is gone.
        hold: called while `web` serves; None: until interrupted.

    Returns:
        The files that were written.

    Raises:
        UsageError: results and recordings are mixed; more than MOST_RUNS.
        FormatError: a source cannot be read; there is no screen and nothing else was asked for.
    """
    given = [sources] if isinstance(sources, str | os.PathLike) else list(sources)
    paths = [path for source in given for path in _found(Path(source))]
    if at is not None and screenshot is None:
        raise UsageError("", "--at is the moment of a picture", hint="give --screenshot as well")
    outputs = [Path(path) for path in (rrd, screenshot) if path is not None]
    for path in outputs:
        check_output(path, force=force, inputs=paths)
    recordings = [path for path in paths if _is_recording(path)]
    if recordings and len(recordings) < len(paths):
        raise UsageError(recordings[0], "recordings and results cannot be shown as one")
    if recordings:
        if rrd is not None or connect is not None:
            raise UsageError(recordings[0], "is a recording already", hint="open it, or --web")
        return _show(recordings, screenshot, at, web=web, force=force, say=say, hold=hold)
    if len(paths) > MOST_RUNS:
        raise UsageError("", f"{len(paths)} results are too many side by side; {MOST_RUNS} at most")
    runs = [read_result(path, notes) for path in paths]
    with ExitStack() as stack:
        address = connect
        if rrd is not None:
            check_room(rrd, LEAST)
            target: Path | None = stack.enter_context(atomic(rrd, force=force, inputs=paths))
        elif screenshot is not None:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="replay-"))
            target = Path(folder) / "run.rrd"
        else:
            target = None
        served = None
        if target is None and address is None:
            if web:
                served = serve_web()
                address = served.address
            else:
                address = start_viewer()
        record(runs, target, address, budget=viewer_budget, say=say)
        if screenshot is not None and target is not None:
            _picture(target, Path(screenshot), at, force=force, say=say)
        if served is not None:
            say(f"web     {served.page}")
            _hold(served, hold)
    return outputs


def record(
    runs: Sequence[RunFile],
    path: Path | None,
    address: str | None,
    *,
    budget: float = BUDGET,
    say: Callable[[str], object] = print,
) -> None:
    """Draw results into one recording.

    Args:
        runs: results that were read; several lie side by side.
        path: of an .rrd that is there to be written over; None: none.
        address: of a viewer; None: none.
        budget: MB of each run, about.
        say: is told when the viewer is gone.

    Raises:
        FormatError: the file could not be written.
    """
    names = _names([run.path for run in runs])
    scenes: list[Scene] = [scene_of_file(run, name) for run, name in zip(runs, names, strict=True)]
    alone = len(runs) == 1
    roots = [""] if alone else [f"/run{i}" for i in range(len(runs))]
    identity = f"replay-{os.getpid()}-{time.monotonic_ns()}"
    title = " | ".join(names)
    streams = Streams(title, identity, blueprint(scenes, roots), path, address)
    try:
        for i, (run, scene) in enumerate(zip(runs, scenes, strict=True)):
            drawing = Drawing(
                scene,
                streams.send,
                root=roots[i],
                budget=budget,
                name="" if alone else names[i],
                colour=None if alone else RUN_COLOURS[i % len(RUN_COLOURS)],
            )
            for event in events(run):
                if isinstance(event, Block):
                    drawing.block(event)
                else:
                    drawing.keyframe(event)
            if scene.drawn or scene.walls.any():
                with suppress(FormatError):  # a plan without walls
                    drawing.walls(walls_of(of_run(run)))
            drawing.close()
        gone = streams.close()
    except OSError as error:
        raise FormatError(path or "", f"could not be written: {error}") from error
    if gone:
        say(f"viewer: gone ({gone})")


def _show(
    recordings: list[Path],
    screenshot: AnyPath | None,
    at: float | None,
    *,
    web: bool,
    force: bool,
    say: Callable[[str], object],
    hold: Callable[[Web], object] | None,
) -> list[Path]:
    """Recordings as they are."""
    if screenshot is not None:
        if len(recordings) > 1:
            raise UsageError(recordings[1], "a picture shows one recording")
        _picture(recordings[0], Path(screenshot), at, force=force, say=say)
        return [Path(screenshot)]
    if web:
        served = serve_web(recordings)
        say(f"web     {served.page}")
        _hold(served, hold)
    else:
        start_viewer(recordings)
    return []


def _picture(
    recording: Path,
    picture: Path,
    at: float | None,
    *,
    force: bool,
    say: Callable[[str], object],
) -> None:
    from replay.viewing.shots import screenshot

    with atomic(picture, force=force, inputs=[recording]) as part:
        for complaint in screenshot(recording, part, at):
            say(f"viewer: {complaint}")


def _hold(served: Web, hold: Callable[[Web], object] | None) -> None:
    try:
        if hold is not None:
            hold(served)
        else:
            served.process.wait()
    except KeyboardInterrupt:
        pass  # which is how one ends it
    finally:
        served.close()


def _found(source: Path) -> list[Path]:
    """The file, or the results in the folder."""
    if not source.exists():
        raise FormatError(source, "does not exist")
    if not source.is_dir():
        return [source]
    found = sorted(source.rglob(f"*{SUFFIX}"))
    if not found:
        raise FormatError(source, f"holds no results: no *{SUFFIX}")
    if len(found) > MOST_RUNS:
        hint = f"name up to {MOST_RUNS} of them"
        raise UsageError(source, f"holds {len(found)} results, too many side by side", hint=hint)
    return found


def _is_recording(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def _names(paths: Iterable[Path]) -> list[str]:
    """What tells the runs apart: their stems, with folders and numbers where those are the same."""
    every = list(paths)
    stems = [path.name.removesuffix(".mcap").removesuffix(".replay") for path in every]
    if len(set(stems)) < len(stems):
        stems = [f"{path.parent.name}/{stem}" for path, stem in zip(every, stems, strict=True)]
    if len(set(stems)) < len(stems):
        stems = [f"{stem} ({i + 1})" for i, stem in enumerate(stems)]
    return stems
