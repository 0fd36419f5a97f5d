"""A log that is a list of messages."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path

from formats.log import Container, Message, Topic


class MemoryLog:
    """A formats.log.Log over a list of messages."""

    def __init__(self, messages: list[Message], path: Path = Path("memory")) -> None:
        times = [message.time_ns for message in messages]
        self.path = path
        self._messages = messages
        self.container = Container(
            "memory", "none", 0, min(times, default=0), max(times, default=0), True, "complete"
        )

    def topics(self) -> list[Topic]:
        """Sorted by name and type."""
        found = {message.topic for message in self._messages}
        return sorted(found, key=lambda topic: (topic.name, topic.type))

    def messages(self, topics: Collection[Topic] | None = None) -> Iterator[Message]:
        """In the order of log time."""
        return (m for m in self._messages if topics is None or m.topic in topics)

    def close(self) -> None:
        """Nothing to give back."""
