"""Cut and randomly damaged MCAP files: the same, an error of ours, or a counted loss."""

from __future__ import annotations

import bisect
import functools
import random
import struct
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.errors import FormatError, Notes
from formats.mcap import records as r
from formats.mcap.log import open_file
from tests.mcap_files import ALL, McapBytes, scan_definitions

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

Read = list[tuple[str, int, bytes]]
VARIANTS: dict[str, dict[str, Any]] = {
    "zstd": {"compression": "zstd"},
    "lz4": {"compression": "lz4"},
    "none": {"compression": ""},
    "unchunked": {"features": ALL - {"ch"}},
    "no summary": {"features": {"ch"}},
    "no CRC": {"chunk_crc": False, "data_crc": False, "summary_crc": False},
    "unchunked, bare": {"features": set(), "data_crc": False},
}
PROTECTED = ("zstd", "lz4", "none", "unchunked", "no summary")  # messages have a CRC


@functools.cache
def scans(variant: str, count: int = 40) -> tuple[McapBytes, bytes]:
    """A file of scans of 200 beams on /scan1, with small messages on /scan2 between them."""
    file = McapBytes(chunk_messages=32, **VARIANTS[variant]).add(*scan_definitions(2))
    rng = np.random.default_rng(5)
    room = 4 + np.sin(np.linspace(0, 20, 200))
    file.add(r.Attachment(1, 2, "plan.png", "image/png", bytes(range(256)), 1))
    file.add(r.Metadata("run", {"robot": "turtlebot"}))
    for number in range(count):
        at = number * 100_000_000
        ranges = np.round(room + rng.normal(0, 0.01, 200), 3).astype("<f4").tobytes()
        file.add(r.RawMessage(1, number, at, at, b"\0\1\0\0" + ranges))
        for part in range(3):
            stamp = struct.pack("<IQ", 1, at + part)
            file.add(r.RawMessage(2, number, at + part + 1, at, stamp))
    return file, file.finish()


def read(path: Path) -> tuple[Read, Notes]:
    notes = Notes()
    log = open_file(path, notes)
    found = [(m.topic.name, m.time_ns, bytes(m.data)) for m in log.messages()]
    list(log.attachments())
    list(log.metadata())
    log.close()
    return found, notes


def whole_messages(records: bytes) -> int:
    """How many of these records are whole messages."""
    at = count = 0
    while at + 9 <= len(records):
        after = at + 9 + int.from_bytes(records[at + 1 : at + 9], "little")
        if after > len(records):
            break
        count += records[at] == r.MESSAGE
        at = after
    return count


def physically_there(file: McapBytes, whole: bytes, cut: int) -> int:
    """Messages that lie whole before this byte; of a cut chunk, what its decompressor gives.

    Bytes are fed to the decompressor one by one, so that nothing that can come out is missed.
    """
    there = bisect.bisect_right(file.ends, cut)
    for begin, end in file.chunks:
        if begin + 50 > cut:
            break
        letters = int.from_bytes(whole[begin + 37 : begin + 41], "little")
        packed = whole[begin + 41 + letters + 8 : min(end, cut)]
        data = b"" if letters else packed
        if letters:
            kind: Any = zstd.ZstdDecompressor if letters == 4 else lz4.frame.LZ4FrameDecompressor
            machine = kind()
            for place in range(len(packed)):
                data += machine.decompress(packed[place : place + 1])
        there += whole_messages(data)
    return there


@pytest.mark.parametrize("variant", ["zstd", "lz4", "none", "unchunked"])
def test_54_cuts_give_what_is_physically_there(variant: str, tmp_path: Path) -> None:
    file, whole = scans(variant, 150)
    path = tmp_path / "cut.mcap"
    recovered = there = 0
    for cut in np.linspace(0, len(whole), 56).astype(int)[1:-1].tolist():
        path.write_bytes(whole[:cut])
        recovered += len(read(path)[0])
        there += physically_there(file, whole, cut)
    assert there > 10_000
    assert recovered >= 0.98 * there


def damaged(data: bytes, seed: int) -> bytes:
    """A file after one to three accidents: bytes changed, zeroed, removed, added, or a cut."""
    rng = random.Random(seed)
    found = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        at = rng.randrange(len(found))
        size = rng.choice([1, 1, 2, 8, 50, 4096])
        accident = rng.randrange(6)
        if accident == 0:
            found[at] ^= 1 << rng.randrange(8)
        elif accident == 1:
            found[at : at + size] = rng.randbytes(len(found[at : at + size]))
        elif accident == 2:
            found[at : at + size] = bytes(len(found[at : at + size]))
        elif accident == 3:
            del found[at : at + size]
        elif accident == 4:
            found[at:at] = rng.randbytes(size)
        else:
            del found[max(at, 8) :]
    return bytes(found)


def check_damage(variant: str, seed: int) -> str:
    """Read a damaged file; what came of it, checked to be one of the outcomes that may be."""
    _, whole = scans(variant)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "whole.mcap"
        path.write_bytes(whole)
        expected, _ = read(path)
        path.write_bytes(damaged(whole, seed))
        begin = time.process_time()
        try:
            found, notes = read(path)
        except FormatError:
            return "error"
        finally:
            assert time.process_time() - begin < 20
    if found == expected:
        return "same"
    if variant in PROTECTED:
        assert list(notes), "a silent difference"
        # Messages whose CRC holds are the ones that were recorded.
        missing = Counter(expected) - Counter(found)
        if missing and path_is_whole(notes):
            assert notes.total("lost"), "messages are missing and nothing says so"
    return "loss"


def path_is_whole(notes: Notes) -> bool:
    """Whether no note says that the file is cut: what a cut took away nobody can count."""
    return not any("cut" in note.problem or "no end" in note.problem for note in notes)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.sampled_from(sorted(VARIANTS)), st.integers(0, 2**32))
def test_random_damage(variant: str, seed: int) -> None:
    check_damage(variant, seed)


@pytest.mark.slow
@pytest.mark.parametrize("variant", sorted(VARIANTS))
def test_2000_random_damages(variant: str) -> None:
    outcomes = Counter(check_damage(variant, seed) for seed in range(2000))
    assert outcomes["same"] > 10
    assert outcomes["loss"] > 500
