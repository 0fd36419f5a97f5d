"""Relations files of the SLAM benchmark of Freiburg: where one pose ought to be seen from another.

Kümmerle et al., "On measuring the accuracy of SLAM algorithms" (Autonomous Robots 2009): two times
in s, then x y z in m and roll pitch yaw in rad of the second pose in the first one's frame, made
by hand from scans that overlap.
"""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from math import isfinite
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError, printable
from formats.errors import Path as AnyPath
from formats.frame import Floats

LONGEST_LINE = 4096
WORDS = 8


class Relations(NamedTuple):
    """What is true of pairs of poses.

    Attributes:
        first_ns, second_ns: (k,) int64 times of the two poses, in any order.
        poses: (k, 3) x y yaw of the second one in the frame of the first, m, m, rad.
    """

    first_ns: npt.NDArray[np.int64]
    second_ns: npt.NDArray[np.int64]
    poses: Floats


def read_relations(path: AnyPath) -> Relations:
    """Read a relations file; only the plane counts: z, roll and pitch are left out.

    Raises:
        FormatError: a line is no relation, or there are none; with the line's number.
    """
    times: list[tuple[int, int]] = []
    poses: list[tuple[float, float, float]] = []
    try:
        with Path(path).open(encoding="utf-8-sig", errors="replace") as file:
            number = 0
            while line := file.readline(LONGEST_LINE):
                number += 1
                words = line.split()
                if not words or words[0].startswith("#"):
                    continue
                found = _relation(words)
                if found is None:
                    said = printable(line.strip(), 60)
                    raise FormatError(
                        path,
                        f"not a relation: {said}",
                        at=f"line {number}",
                        hint="each line is: time1 time2 x y z roll pitch yaw",
                    )
                times.append(found[0])
                poses.append(found[1])
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror}") from error
    if not times:
        raise FormatError(path, "no relations in it")
    first, second = np.array(times, dtype=np.int64).T
    return Relations(first, second, np.array(poses))


def _relation(words: list[str]) -> tuple[tuple[int, int], tuple[float, float, float]] | None:
    """Times in ns and the pose in the plane; None where the words are no relation."""
    if len(words) != WORDS:
        return None
    try:
        moments = [Decimal(word) for word in words[:2]]
        numbers = [float(word) for word in words[2:]]
    except (InvalidOperation, ValueError):
        return None
    if not all(t.is_finite() and abs(t) < 10**10 for t in moments) or not all(
        map(isfinite, numbers)
    ):
        return None
    first, second = (int((t * 10**9).to_integral_value()) for t in moments)
    return (first, second), (numbers[0], numbers[1], numbers[5])
