"""What lies in a result file that is whole to the last bit: metadata, attachments, messages."""

from __future__ import annotations

import json
import mmap
import stat
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from zlib import crc32

from formats.errors import FormatError, Notes
from formats.mcap.log import open_file

FORMAT = 1  # of the file; raised when an older reader would misread it
RECORD = "replay"  # the metadata record that makes an MCAP a result
MAX_CHUNK = 1 << 32  # bytes: what re-scoring needs of 100 million cells is one message
AGAIN = "run `replay run` on its log again"
DATA_END, FOOTER = 13, 37  # bytes that end an MCAP: of the record; of the footer and the magic

Stream = list[tuple[int, bytes]]  # log time (ns) and payload of each message of a topic
Messages = dict[str, Stream]


def opened(
    path: Path, read: tuple[str, ...], notes: Notes | None
) -> tuple[dict[str, Any], dict[str, dict[str, str]], dict[str, bytes], Messages]:
    """The record "replay", all metadata, attachments, and messages, of a sound file."""
    must_be_file(path)
    metadata, attachments, messages = _contents(path, notes or Notes(), read)
    if RECORD not in metadata:
        hint = "`replay run` writes results; `replay info` looks into logs"
        raise FormatError(path, f'not a result of replay: no metadata record "{RECORD}"', hint=hint)
    if not _sound(path):
        raise FormatError(path, "damaged: the checksum of its data does not match", hint=AGAIN)
    return read_record(path, metadata[RECORD]), metadata, attachments, messages


def must_be_file(path: Path) -> None:
    """Refuse what would let a reader wait for ever: pipes, sockets, devices.

    Raises:
        FormatError: it is one of them.
    """
    with suppress(OSError):  # not there, a name too long: opening it says so
        mode = path.stat().st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise FormatError(path, "is not a regular file")


@contextmanager
def fitting(path: Path) -> Iterator[None]:
    """A file may say anything; what it says wrong is one line."""
    try:
        yield
    except FormatError:
        raise
    except Exception as error:
        problem = f"a result that does not fit together ({type(error).__name__}: {error})"
        raise FormatError(path, problem, hint=AGAIN) from error


def read_record(path: Path, fields: Mapping[str, str]) -> dict[str, Any]:
    """The metadata record, decoded, if its format is one that this reader knows.

    Raises:
        FormatError: of a newer format, or malformed.
    """
    try:
        version = int(fields["format"])
        if version > FORMAT:
            problem = f"a result of format {version}; this replay reads up to {FORMAT}"
            raise FormatError(path, problem, hint="update replay")
        return {key: json.loads(value) for key, value in fields.items()}
    except (ValueError, KeyError, RecursionError) as error:
        problem = f'the metadata record "{RECORD}" is malformed ({type(error).__name__}: {error})'
        raise FormatError(path, problem) from error


def _contents(
    path: Path, notes: Notes, read: tuple[str, ...]
) -> tuple[dict[str, dict[str, str]], dict[str, bytes], Messages]:
    """Metadata, attachments, and messages by topic, of a file that is whole to the last bit."""
    said = Notes()
    log = open_file(path, said, MAX_CHUNK)
    try:
        metadata = dict(log.metadata())
        attachments = {name: bytes(data) for name, _, data in log.attachments()}
        messages: Messages = {}
        topics = [topic for topic in log.topics() if topic.name.startswith(read)]
        for topic, time, data in log.messages(topics):
            messages.setdefault(topic.name, []).append((time, bytes(data)))
        state = log.container.state if not log.container.whole else ""
    finally:
        log.close()
    lost = [f"{note.problem} at {note.at}" for note in said.of("lost")]
    if state or lost:
        raise FormatError(path, f"damaged: {state or ', '.join(lost)}", hint=AGAIN)
    for note in said:
        notes.add(note.kind, path, note.problem, topic=note.topic, at=note.at, count=note.count)
    return metadata, attachments, messages


def _sound(path: Path) -> bool:
    """Whether the checksum of the data section holds, the only one that covers metadata.

    The footer says where the summary begins; the record DataEnd with the checksum ends there.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        (summary,) = struct.unpack_from("<Q", data, len(data) - FOOTER + 9)
        end = min(summary, len(data)) - DATA_END
        if end < 0 or data[end] != 0x0F:
            return False
        (crc,) = struct.unpack_from("<I", data, end + 9)
        with memoryview(data) as view, view[:end] as checked:
            return crc in (0, crc32(checked))  # 0: whoever copied the file left it out
