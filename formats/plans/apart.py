"""Drawings of lines are rendered in a process apart: bounded in time and memory, whatever happens.

PDF, SVG and DXF are programs more than data; what hangs, crashes or swallows memory there ends as
one line here.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from formats.errors import FormatError, Notes, printable
from formats.picture_header import PictureError
from formats.plans.ink import drawn
from formats.plans.map_yaml import MapYaml
from formats.plans.paper import Asked, Opened, Sheet

SECONDS = 120
MEMORY = 6 << 30  # bytes of address space, a good part of which is never touched
CHILD = "from formats.plans.apart import child; child()"


def opener(kind: str) -> Callable[[Path, bytes, MapYaml | None, Asked, Notes], Opened]:
    """What opens a drawing by `render` of formats.plans.KIND."""

    def open_drawing(
        path: Path, data: bytes, _values: MapYaml | None, asked: Asked, notes: Notes
    ) -> Opened:
        sheet = rendered(kind, path, data, asked)
        for remark in sheet.remarks:
            notes.warn(path, remark)
        return drawn(path, sheet.grey, asked.invert, notes), sheet

    return open_drawing


def rendered(kind: str, path: Path, data: bytes, asked: Asked, seconds: float = SECONDS) -> Sheet:
    """Render a drawing in a process apart.

    Args:
        kind: "pdf", "svg" or "dxf".
        path: its name, for messages.
        data: the whole file.
        asked: page, dpi, scale.
        seconds: that it may take.

    Raises:
        FormatError: damaged, hostile, too large, or nothing to see.
    """
    head = json.dumps({"kind": kind, **asdict(asked)}).encode() + b"\n"
    folder = str(Path(__file__).resolve().parents[2])
    before = [folder, *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(before), "OPENBLAS_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            [sys.executable, "-c", CHILD],
            input=head + data,
            capture_output=True,
            timeout=seconds,
            env=environment,
            check=False,
        )
    except subprocess.TimeoutExpired:
        hint = "simplify it, or save the part that matters"
        raise FormatError(path, f"not rendered within {seconds:g} s", hint=hint) from None
    except (OSError, MemoryError) as error:
        raise FormatError(path, f"cannot be rendered: {error}") from None
    line, _, pixels = done.stdout.partition(b"\n")
    if not line:
        hint = "save it again, or as PNG"
        raise FormatError(path, f"its {kind.upper()} renderer ended (damaged?)", hint=hint)
    facts: dict[str, Any] = json.loads(line)
    if "problem" in facts:
        raise FormatError(path, facts["problem"], hint=facts["hint"])
    grey = np.frombuffer(pixels, np.uint8).reshape(facts["shape"])
    scales, remarks = tuple(facts["scales"]), tuple(facts["remarks"])
    return Sheet(grey, facts["paper"], scales, facts["resolution"], remarks)


def child() -> None:
    """The process apart: options and file from stdin; facts and pixels, or a problem, to stdout."""
    with contextlib.suppress(ImportError, ValueError, OSError):  # not on Windows; not over a limit
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("ignore")
    options = json.loads(sys.stdin.buffer.readline())
    data = sys.stdin.buffer.read()
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no answer
    kind = options.pop("kind")
    problem, hint = "", "save it again, or as PNG"
    try:
        sheet = importlib.import_module(f"formats.plans.{kind}").render(data, Asked(**options))
    except PictureError as error:
        problem, hint = error.problem, error.hint
    except MemoryError:
        problem = "rendering it takes too much memory"
    except RecursionError:
        problem = "is nested too deep, or holds itself"
    except Exception as error:  # every library has its own; all of them mean damage
        problem = f"is damaged: {printable(error) or type(error).__name__}"
    if problem:
        out.write(json.dumps({"problem": problem, "hint": hint}).encode() + b"\n")
    else:
        facts = {
            name: getattr(sheet, name) for name in ("paper", "scales", "resolution", "remarks")
        }
        out.write(json.dumps({**facts, "shape": sheet.grey.shape}).encode() + b"\n")
        out.write(np.ascontiguousarray(sheet.grey).data)
    out.flush()
    os._exit(0)  # libraries that crash while they clean up have done their work
