"""Logs over other logs: several as one, and one over a temporary copy."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from heapq import merge

from formats.log import Container, Log, Message, Topic


class Unpacked:
    """A log over a temporary copy, which goes when it is closed.

    Args:
        log: in the copy.
        discard: what removes it.
        size: bytes of what was copied.
        packed: how that was compressed, "" for not.
    """

    def __init__(self, log: Log, discard: Callable[[], None], size: int, packed: str) -> None:
        self._log, self._discard, self._size, self._packed = log, discard, size, packed
        self.path = log.path

    @property
    def container(self) -> Container:
        """Of the log inside, with the size and compression of what was copied."""
        found = self._log.container
        if not self._packed:
            return replace(found, size=self._size)
        inner = "" if found.compression == "none" else f"{found.compression} in "
        return replace(found, size=self._size, compression=inner + self._packed)

    def topics(self) -> list[Topic]:
        """Every topic."""
        return self._log.topics()

    def messages(self, topics: Collection[Topic] | None = None) -> Iterator[Message]:
        """As the log inside gives them."""
        return self._log.messages(topics)

    def close(self) -> None:
        """Close the log and drop the copy."""
        self._log.close()
        self._discard()


class MergedLog:
    """Several logs as one: topics joined by name, type and encoding, messages by log time."""

    def __init__(self, logs: list[Log]) -> None:
        self._logs = logs
        self.path = logs[0].path
        self._joined: dict[tuple[str, str, str], Topic] = {}
        for topic in (topic for log in logs for topic in log.topics()):
            key = topic.name, topic.type, topic.encoding
            known = self._joined.get(key)
            if known is None:
                self._joined[key] = topic
            else:
                unknown = known.count is None or topic.count is None
                count = None if unknown else (known.count or 0) + (topic.count or 0)
                self._joined[key] = replace(known, count=count)

    @property
    def container(self) -> Container:
        """All of them together."""
        each = [log.container for log in self._logs]
        times = [c for c in each if c.end_ns > 0] or each
        return Container(
            " + ".join(dict.fromkeys(c.kind for c in each)),
            ", ".join(dict.fromkeys(c.compression for c in each)),
            sum(c.size for c in each),
            min(c.start_ns for c in times),
            max(c.end_ns for c in times),
            all(c.whole for c in each),
            "; ".join(dict.fromkeys(c.state for c in each)),
        )

    def topics(self) -> list[Topic]:
        """Every topic, sorted by name, type and encoding."""
        return [topic for _, topic in sorted(self._joined.items())]

    def messages(self, topics: Collection[Topic] | None = None) -> Iterator[Message]:
        """Messages of all logs, by log time, then in the order in which the logs were given."""
        wanted = self.topics() if topics is None else topics
        keys = {(t.name, t.type, t.encoding) for t in wanted}
        streams = [self._stream(log, keys) for log in self._logs]
        return merge(*streams, key=lambda message: message.time_ns)

    def _stream(self, log: Log, keys: set[tuple[str, str, str]]) -> Iterator[Message]:
        table = {
            id(t): (t, self._joined[t.name, t.type, t.encoding])
            for t in log.topics()
            if (t.name, t.type, t.encoding) in keys
        }
        by_key = {(t.name, t.type, t.encoding): joined for t, joined in table.values()}
        for topic, time_ns, data in log.messages([own for own, _ in table.values()]):
            known = table.get(id(topic))
            joined = known[1] if known else by_key[topic.name, topic.type, topic.encoding]
            yield Message(joined, time_ns, data)

    def close(self) -> None:
        """Close all of them."""
        for log in self._logs:
            log.close()
