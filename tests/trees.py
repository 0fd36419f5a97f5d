"""Transform trees of tests, in seconds."""

from __future__ import annotations

import numpy as np

from formats.errors import Notes
from formats.messages import Numbers, Transform
from formats.streaming.clock import SECOND
from formats.streaming.tf import Tree

IDENTITY: Numbers = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def numbers(x: float, y: float, yaw: float) -> Numbers:
    return (x, y, 0.0, 0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))


def tree() -> Tree:
    return Tree("log.bag", Notes())


def put(
    tf: Tree, parent: str, child: str, t: float, what: Numbers = IDENTITY, *, static: bool = False
) -> None:
    ns = round(t * SECOND)
    tf.add([Transform(ns, parent, child, what)], ns, static=static)


def at(tf: Tree, target: str, source: str, *seconds: float, mounted: bool = False) -> object:
    return tf.lookup(target, source, [round(t * SECOND) for t in seconds], mounted=mounted)
