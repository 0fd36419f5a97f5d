"""Where a genetic search stands, as a file: a search that is cut goes on to the same bits.

The file is a plain numpy archive of numbers and one JSON text; nothing in it is ever executed.
"""

from __future__ import annotations

import io
import json
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from formats.errors import FormatError, UsageError
from formats.errors import Path as AnyPath
from formats.output import write_bytes
from replay.tuning.search import Objective, Search, State

FORMAT = "replay search 1"
PROBES = 33  # along a diagonal: a search of other data has other objectives there
ARRAYS = ("x", "f", "rank", "crowding")


def fingerprint(objective: Objective, search: Search) -> str:
    """What a checkpoint is for: the settings, and the objectives at some places."""
    p = np.linspace(0.1, 1.0, PROBES)
    places = np.concatenate([np.column_stack([p, p]), np.column_stack([p, p[::-1]])])
    said = {name: v for name, v in asdict(search).items() if name != "generations"}
    return sha256(json.dumps(said).encode() + objective(places).tobytes()).hexdigest()


def save(path: AnyPath, state: State, mark: str) -> None:
    """Write the state whole or not at all, over an older one.

    Raises:
        FormatError: it cannot be written.
    """
    said = {
        "format": FORMAT,
        "mark": mark,
        "random": state.random,
        "generation": state.generation,
        "step": state.step,
        "ended": state.ended,
        "spreads": state.spreads,
    }
    out = io.BytesIO()
    np.savez_compressed(
        out,
        said=np.frombuffer(json.dumps(said).encode(), dtype=np.uint8),
        evaluated=np.concatenate(state.evaluated),
        values=np.concatenate(state.values),
        **{name: getattr(state, name) for name in ARRAYS},
    )
    write_bytes(path, out.getvalue(), force=True)


def load(path: AnyPath, mark: str) -> State:
    """Read a state back.

    Args:
        path: of the file.
        mark: the fingerprint of what is to be searched now.

    Raises:
        FormatError: not readable or no such file.
        UsageError: it was made for other data or other settings.
    """
    try:
        with Path(path).open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            arrays = {name: file[name] for name in (*ARRAYS, "said", "evaluated", "values")}
        said = json.loads(arrays.pop("said").tobytes())
        if said["format"] != FORMAT:
            raise FormatError(path, "is a search of another version of replay")
        evaluated, values = arrays.pop("evaluated"), arrays.pop("values")
        state = State(
            **arrays,
            random=said["random"],
            generation=int(said["generation"]),
            step=float(said["step"]),
            ended=str(said["ended"]),
            spreads=[float(value) for value in said["spreads"]],
            evaluated=[evaluated],
            values=[values],
        )
        np.random.default_rng(0).bit_generator.state = state.random
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror or error}") from None
    except (
        ValueError,
        KeyError,
        TypeError,
        EOFError,
        AttributeError,
        RecursionError,
        BadZipFile,
    ) as error:
        raise FormatError(path, f"is no checkpoint of a search ({type(error).__name__})") from None
    if said["mark"] != mark:
        raise UsageError(
            path,
            "is the checkpoint of another search: other data or other settings",
            hint="give the same ones, or another file",
        )
    return state
