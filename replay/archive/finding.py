"""What is meant by ARCHIVE...: result files, folders of them, patterns, addresses."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterable, Iterator
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from formats.errors import FormatError
from formats.output import is_folder, is_there
from replay.archive.places import RESULT, Place, is_remote, join, listed

FAILED = ".failed.json"
MAGIC = "*?["


class Found(NamedTuple):
    """A result: the place to read it from, and its name within its archive."""

    place: str
    name: str


def places(wanted: Place | Iterable[Place]) -> list[Place]:
    """One place or several, as several."""
    return [wanted] if isinstance(wanted, str | PathLike) else list(wanted)


def results_in(archives: Place | Iterable[Place], suffix: str = RESULT) -> Iterator[Found]:
    """The results in archives, in the order of their names; a file that is named is taken as it is.

    Raises:
        FormatError: an archive is not there.
    """
    for place in places(archives):
        text = os.fspath(place)
        if is_remote(text):
            if text.endswith(suffix):
                yield Found(text, text.rsplit("/", 1)[-1])
            else:
                yield from _under(text, suffix)
        elif is_folder(text):
            yield from _under(text, suffix)
        elif is_there(text):
            if suffix == RESULT:
                yield Found(text, Path(text).name)
        elif any(letter in text for letter in MAGIC):
            hits = sorted(glob.glob(text, recursive=True))  # noqa: PTH207 - it may be absolute
            yield from (Found(hit, hit) for hit in hits if hit.endswith(suffix))
        else:
            raise FormatError(text, "does not exist")


def _under(place: str, suffix: str) -> Iterator[Found]:
    return (Found(join(place, name), name) for name in listed(place) if name.endswith(suffix))
