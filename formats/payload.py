"""The bytes of a message, however it is encoded: what cannot be read of them, and what is odd."""

from __future__ import annotations

import json
from typing import Any

Payload = bytes | memoryview
SECOND = 1_000_000_000
MOST_ITEMS = 1 << 18  # of structures: each costs far more memory than its bytes on the wire
IMPLAUSIBLE = 1 << 28  # bytes: a length beyond this is a wrong number, not a missing rest
LONGEST_JSON = 1 << 26  # bytes: as Python objects it is many times as large


class Undecodable(Exception):  # noqa: N818  (what the payload is)
    """A payload that cannot be read: it costs this one message.

    Args:
        reason: the same words for the same fault, to count by.
        detail: the figures of this message.
    """

    def __init__(self, reason: str, detail: str = "") -> None:
        super().__init__(f"{reason} ({detail})" if detail else reason)
        self.reason = reason


class OddStamp(int):
    """A stamp in ns whose nanoseconds were a second or more; they are carried."""


def odd_stamp(stamp_ns: int) -> str:
    """What is odd about a decoded stamp, "" where nothing is. 2038 and later are not odd."""
    if stamp_ns < 0:
        return "stamp before 1970"
    return "nanoseconds of a second or more, carried" if type(stamp_ns) is OddStamp else ""


def plain_text(raw: bytes) -> str:
    """Text of a file, whatever its bytes are; two texts are equal only where their bytes are."""
    return raw.decode("utf-8", "backslashreplace")


def cut(size: int, needed: int, what: str) -> Undecodable:
    """Why `needed` bytes are not there: the rest is missing, or a length is not one."""
    if needed > IMPLAUSIBLE:
        return Undecodable(f"impossible number of {what}", f"{needed} of {size} bytes")
    return Undecodable("cut short", f"after {size} of {needed} bytes")


def from_json(data: Payload) -> dict[str, Any]:
    """The object in a JSON payload."""
    if len(data) > LONGEST_JSON:
        raise Undecodable("implausibly long JSON", f"{len(data)} bytes")
    try:
        found = json.loads(bytes(data))
    except (ValueError, RecursionError) as error:
        raise Undecodable("not JSON", str(error)[:80]) from None
    if not isinstance(found, dict):
        raise Undecodable("not of its schema", f"a JSON {type(found).__name__}")
    return found
