"""`@njit` for every kernel: compiled once, cached in a place that is surely writable."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

Kernel = TypeVar("Kernel", bound=Callable[..., object])


def cache_folder() -> Path | None:
    """The first of the user's cache folder and a temporary one that we own and can write to.

    numba runs what it finds there, so a folder that somebody else made is not trusted. None where
    nothing is writable.
    """
    owner = os.getuid() if hasattr(os, "getuid") else None
    user = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    for place in (
        Path(user) / "plan-replay" / "numba",
        Path(tempfile.gettempdir()) / f"plan-replay-numba-{owner or 0}",
    ):
        try:
            folder = place.expanduser()
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except (OSError, RuntimeError):  # RuntimeError: no home folder is known
            continue
        if owner is None or folder.stat().st_uid == owner:
            return folder
    return None


# numba reads this when it is imported, and where package and home are both unwritable it raises
# without it.
if "NUMBA_CACHE_DIR" not in os.environ:
    _folder = cache_folder()
    if _folder is not None:
        os.environ["NUMBA_CACHE_DIR"] = str(_folder)

import numba  # noqa: E402


def njit(kernel: Kernel) -> Kernel:
    """Compile a kernel at its first call; the machine code is kept for later processes.

    No fast-math, so that the same input gives the same bits.
    """
    options = {"nogil": True, "error_model": "numpy", "fastmath": False}
    try:
        return numba.njit(cache=True, **options)(kernel)
    except RuntimeError:  # no writable place: compile in every process
        return numba.njit(**options)(kernel)
