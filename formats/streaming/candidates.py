"""Which topics may be the scan and the poses, by what they are."""

from __future__ import annotations

import re

from formats.decoding import decoder_of
from formats.errors import FormatError, UsageError, printable
from formats.log import Log, Topic, listing, named
from formats.sensing.scans import SENSORS
from formats.streaming.depth_topics import depth_topics
from formats.streaming.gathering import POSE_TYPES

FEW = 0.1  # a topic with less than this share of another's messages is not its peer


def scan_topics(log: Log, wish: str = "") -> list[Topic]:
    """Topics that may be the scan: of the best kind of sensor, and not with few messages only.

    Raises:
        UsageError: the wished topic is not there or is not a scan.
        FormatError: there is none.
    """
    topics = log.topics()
    readable = [t for t in topics if t.type in SENSORS and decoder_of(t) is not None]
    if wish:
        if found := _one_encoding(log, named(readable, wish)):
            return found[:1]
        other = named(topics, wish)
        problem = f"{other[0].type} is not a scan" if other else "no such topic"
        hint = f"scans here: {listing(readable) or 'none'}"
        raise UsageError(log.path, problem, topic=wish, hint=hint)
    readable, colour = [t for t in readable if t.count != 0], ""
    for rank in sorted({SENSORS[t.type].rank for t in readable}):
        best, why = depth_topics(log, [t for t in readable if SENSORS[t.type].rank == rank])
        if best:
            return _one_encoding(log, peers(best))
        colour = colour or why
    if not any(t.count != 0 for t in topics):
        raise FormatError(log.path, "no messages")
    kinds = ", ".join(dict.fromkeys(re.split("[/.]", name)[-1] for name in SENSORS))
    strange = [t for t in topics if t.type in SENSORS and decoder_of(t) is None]
    hint = colour or "record a topic of one of these types"
    if strange and not colour:
        told = ", ".join(f"{printable(t.name)} as {printable(t.encoding)}" for t in strange)
        hint = f"{told} cannot be decoded: record cdr, ros1 or json"
    raise FormatError(log.path, f"no scans: looked for {kinds}; found {listing(topics)}", hint=hint)


def _one_encoding(log: Log, topics: list[Topic]) -> list[Topic]:
    """The topics; several logs may say the same in other encodings, of which none is all."""
    for topic in topics:
        alike = [t for t in topics if (t.name, t.type) == (topic.name, topic.type)]
        if len(alike) > 1:
            encodings = " and ".join(printable(t.encoding) for t in alike)
            problem = f"is recorded as {encodings}, by several logs"
            raise UsageError(log.path, problem, topic=topic.name, hint="run these one by one")
    return topics


def peers(topics: list[Topic]) -> list[Topic]:
    """The topics without those of few messages."""
    most = max((t.count or 0 for t in topics), default=0)
    return [t for t in topics if t.count is None or t.count >= FEW * most]


def pose_topics(log: Log, wish: str = "") -> list[Topic]:
    """Topics that may tell poses.

    Raises:
        UsageError: the wished topic is not there or has no poses.
    """
    topics = log.topics()
    found = [t for t in topics if t.type in POSE_TYPES and decoder_of(t) is not None]
    if not wish:
        return [t for t in found if t.count != 0]
    if wish in ("tf", "none"):
        return []
    if not (wished := named(found, wish)):
        other = named(topics, wish)
        problem = f"{other[0].type} has no poses" if other else "no such topic"
        hint = f"poses here: {listing(found) or 'none'}, or tf"
        raise UsageError(log.path, problem, topic=wish, hint=hint)
    return wished[:1]
