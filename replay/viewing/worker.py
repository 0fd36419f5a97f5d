"""The process beside a run that draws it: `python -c "... main()" ARGUMENTS`.

Importing rerun and encoding takes its own core; a viewer that stops or a disk that is full stops
this process alone. It reads pickles of its parent on stdin and answers one JSON line on stdout.
"""

from __future__ import annotations

import json
import os
import pickle
import sys
import time
from pathlib import Path
from typing import Any

from formats.errors import FormatError
from replay.viewing.drawing import Drawing
from replay.viewing.panels import blueprint
from replay.viewing.process import start_viewer
from replay.viewing.scene import Keyframe, Scene, Sighted, Walls
from replay.viewing.streams import Streams


def main() -> None:
    """Draw until the parent has no more to say; then say what became of it."""
    asked: dict[str, Any] = json.loads(sys.argv[1])
    try:
        answer = _draw(asked)
    except (EOFError, pickle.UnpicklingError):
        os._exit(0)  # the run was interrupted or killed: nobody listens any more
    except OSError as error:
        answer = str(error)
    except FormatError as error:
        answer = error.problem
    print(json.dumps(answer), flush=True)
    os._exit(0)  # threads of rerun may still wait for a viewer or a disk that does not answer


def _draw(asked: dict[str, Any]) -> str:
    """What went wrong, "" if nothing did."""
    address = start_viewer() if asked["view"] else asked["connect"]
    drawing: Drawing | None = None
    streams: Streams | None = None
    while (message := pickle.load(sys.stdin.buffer)) is not None:
        match message:
            case Scene() as scene:
                path = Path(asked["path"]) if asked["path"] else None
                identity = f"replay-{os.getpid()}-{time.monotonic_ns()}"
                layout = blueprint([scene], [""])
                streams = Streams(scene.title, identity, layout, path, address)
                drawing = Drawing(scene, streams.send, budget=asked["budget"])
            case Sighted() as sighted if drawing is not None:
                drawing.block(sighted.seen())
            case Keyframe() as keyframe if drawing is not None:
                drawing.keyframe(keyframe)
            case Walls() as walls if drawing is not None:
                drawing.walls(walls)
            case str() as report if drawing is not None:
                drawing.report(report)
    if drawing is None or streams is None:
        return ""
    drawing.close()
    return streams.close()
