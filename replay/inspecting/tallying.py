"""Every message of a log is counted while the messages that others ask for pass through."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from formats.decoding import decoder_of
from formats.errors import printable
from formats.log import Container, Log, Message, Topic
from formats.messages import Transforms
from formats.payload import Undecodable
from formats.streaming.clock import SECOND
from formats.streaming.tf import plain

MOST_EDGES = 1000  # pairs of frames that are told of one topic; damaged names are endless
FEW_EDGES = 6


@dataclass(eq=False)
class Tally:
    """What passed on one topic.

    Attributes:
        topic: as the container has it.
        count: messages.
        first_ns, last_ns: log times.
        longest_ns: between two messages.
        facts: of the first message that could be decoded, by name; None until then.
        edges: transforms (parent, child) and how many there were.
    """

    topic: Topic
    count: int = 0
    first_ns: int = 0
    last_ns: int = 0
    longest_ns: int = 0
    facts: dict[str, Any] | None = None
    edges: Counter[tuple[str, str]] = field(default_factory=Counter)

    @property
    def rate(self) -> float | None:
        """Messages a second by log times; None where there is no telling."""
        span = self.last_ns - self.first_ns
        return (self.count - 1) * SECOND / span if self.count > 1 and span > 0 else None

    def taker(self) -> Callable[[int, bytes | memoryview], None]:
        """What counts one message: its log time and payload."""
        read = decoder_of(self.topic)

        def take(time_ns: int, data: bytes | memoryview) -> None:
            if self.count:
                self.longest_ns = max(self.longest_ns, time_ns - self.last_ns)
            else:
                self.first_ns = time_ns
            self.last_ns = time_ns
            self.count += 1
            if read is not None and (self.facts is None or self.edges):
                with suppress(Undecodable):  # counted where the topic is used
                    self._keep(read(data))

        return take

    def _keep(self, noun: Any) -> None:
        if self.facts is None:
            self.facts = facts_of(noun)
        if type(noun) is Transforms:
            for _, parent, child, _ in noun.transforms:
                edge = plain(parent), plain(child)
                if edge in self.edges or len(self.edges) < MOST_EDGES:
                    self.edges[edge] += 1


class Tallied:
    """A log that counts all that is in it in the first pass over any of its topics."""

    def __init__(self, log: Log) -> None:
        self._log = log
        self.path = log.path
        self.tallies: list[Tally] = []
        self._whole = False

    @property
    def container(self) -> Container:
        """Of the log itself."""
        return self._log.container

    def topics(self) -> list[Topic]:
        """Of the log itself."""
        return self._log.topics()

    def messages(self, topics: Collection[Topic] | None = None) -> Iterator[Message]:
        """The messages of these topics; the first time every other one is read as well."""
        if self._whole:
            yield from self._log.messages(topics)
            return
        known = self.topics()
        wanted = {_kind(topic) for topic in (known if topics is None else topics)}
        found = {_kind(topic): Tally(topic) for topic in known}
        self.tallies = []
        # Hashing a topic with its definition is slow; the objects live as long as this table.
        table: dict[int, tuple[Callable[[int, bytes | memoryview], None], bool, Topic]] = {}
        for message in self._log.messages():
            topic, time_ns, data = message
            entry = table.get(id(topic))
            if entry is None:
                key = _kind(topic)
                tally = found.setdefault(key, Tally(topic))
                entry = table[id(topic)] = tally.taker(), key in wanted, topic
            entry[0](time_ns, data)
            if entry[1]:
                yield message
        self.tallies = list(found.values())
        self._whole = True

    def count(self) -> list[Tally]:
        """The tallies of the whole log, reading it where no one has done so yet."""
        if not self._whole:
            for _ in self.messages(()):
                pass
        return self.tallies

    def close(self) -> None:
        """Close the log itself."""
        self._log.close()


def _kind(topic: Topic) -> tuple[str, str, str]:
    return topic.name, topic.type, topic.encoding


KEPT = (
    *("frame", "child", "field_of_view", "range_min", "range_max"),
    *("width", "height", "encoding", "format", "resolution"),
)
SIZES = {"ranges": "beams", "echoes": "beams", "points": "points"}


def facts_of(noun: Any) -> dict[str, Any]:
    """What of a decoded message is worth showing, by name; lengths in m, angles in rad."""
    found = {name: getattr(noun, name) for name in KEPT if hasattr(noun, name)}
    for name, what in SIZES.items():
        if hasattr(noun, name):
            found[what] = len(getattr(noun, name))
    if hasattr(noun, "cells"):
        found["height"], found["width"] = noun.cells.shape
    for name in ("frame", "child"):
        if name in found:
            found[name] = plain(found[name])
    return found


def described(tally: Tally) -> str:
    """The first message of a topic in a few words; all its transforms for tf."""
    if tally.edges:
        edges = [f"{printable(a)} > {printable(b)}" for a, b in list(tally.edges)[:FEW_EDGES]]
        more = len(tally.edges) - len(edges)
        return ", ".join(edges) + (f" and {more} more" if more else "")
    known = tally.facts or {}
    words = [f"{known[name]} {name}" for name in ("beams", "points") if name in known]
    if "field_of_view" in known:
        words.append(f"cone of {known['field_of_view']:.3g} rad")
    if "range_max" in known:
        words.append(f"{known['range_min']:.3g}-{known['range_max']:.3g} m")
    if "width" in known:
        what = f"cells of {known['resolution']:.3g} m" if "resolution" in known else "px"
        words.append(f"{known['width']} x {known['height']} {what}")
    words += [printable(known[name]) for name in ("encoding", "format") if known.get(name)]
    if "frame" in known:
        frame, child = printable(known["frame"]), printable(known.get("child", ""))
        words.append((frame or "frame unnamed") + (f" > {child}" if child else ""))
    return ", ".join(words)
