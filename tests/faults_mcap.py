"""Rows 1 to 23: what an MCAP, or what is taken for one, can be."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

from formats.compression import zstd
from formats.mcap import records as r
from tests.faults_case import Given, Table
from tests.faults_world import definitions, drive, mcap_of, messages
from tests.mcap_files import ALL, McapBytes, chunk, message, raw

table = Table()


def put(folder: Path, data: bytes, name: str = "drive.mcap") -> Path:
    path = folder / name
    path.write_bytes(data)
    return path


def whole(**options: Any) -> bytes:
    return mcap_of(drive(), **options).finish()


def beside(*records: bytes, at: int = 1, **options: Any) -> bytes:
    """The drive with records between its chunks, in a file without any index to help."""
    made = mcap_of(drive(), features={"ch"}, data_crc=False, **options)
    made.close_chunk()
    where = made.chunks[at][0]
    made.out[where:where] = b"".join(records)
    return made.finish()


# ---------------------------------------------------------------------------- 1 to 3: no MCAP

for name, data, words in (
    ("0 bytes", b"", "is empty"),
    ("8 bytes", b"\1\2\3\4\5\6\7\x08", "unknown data"),
    ("8 bytes of its magic", r.MAGIC, ""),
    ("PNG", b"\x89PNG\r\n\x1a\n" + bytes(60), "PNG picture"),
    ("text", b"dear diary\n" * 20, "is text"),
    ("HTML", b"<!doctype html><html></html>", "HTML"),
):
    table(1, name, words, code=1)(lambda d, data=data: put(d, data))
LFS = b"version https://git-lfs.github.com/spec/v1\noid sha256:aa\nsize 12345\n"
table(2, "Git LFS pointer", "LFS pointer", "git lfs pull", code=1)(lambda d: put(d, LFS))
table(3, "major version 1", "version 1", code=1)(
    lambda d: put(d, whole().replace(b"\x89MCAP0", b"\x89MCAP1"))
)


# ---------------------------------------------------------------------------- 4 to 6: cuts


@table(4, "power loss in mid-chunk", "cut", "byte", code=3, map="part")
def _(d: Path) -> Path:
    made = mcap_of(drive())
    data = made.finish()
    begin, end = made.chunks[-2]
    return put(d, data[: (begin + end) // 2])


@table(4, "power loss in mid-chunk, lz4", "cut", code=3, map="part")
def _(d: Path) -> Path:
    made = mcap_of(drive(), compression="lz4")
    data = made.finish()
    begin, end = made.chunks[-2]
    return put(d, data[: (begin + end) // 2])


@table(4, "cut in the first chunk: no scan whole", code=1)
def _(d: Path) -> Path:
    made = mcap_of(drive())
    data = made.finish()
    return put(d, data[: made.chunks[0][0] + 60])


for name, gone in (("no end magic", 8), ("no footer", 8 + 29), ("in the summary", 400)):
    table(5, f"cut: {name}", "")(lambda d, gone=gone: put(d, whole()[:-gone]))

for name, features in (
    ("no summary", {"ch", "mx"}),
    ("no chunks", ALL - {"ch", "mx", "chx"}),
    ("no chunk index", ALL - {"chx"}),
    ("no message index", ALL - {"mx"}),
    ("no statistics", ALL - {"st"}),
    ("nothing that is optional", set()),
):
    table(6, name, quiet=True)(lambda d, features=features: put(d, whole(features=features)))
table(6, "CRC 0", quiet=True)(
    lambda d: put(d, whole(chunk_crc=False, data_crc=False, summary_crc=False))
)


# ---------------------------------------------------------------------------- 7 to 10: damage


@table(7, "bit rot in a chunk", "lost", "messages lost", code=3, map="part")
def _(d: Path) -> Path:
    made = mcap_of(drive(), compression="")
    data = bytearray(made.finish())
    begin, end = made.chunks[2]
    data[(begin + end) // 2] ^= 8
    return put(d, bytes(data))


@table(7, "bit rot without an index", code=3, map="part")
def _(d: Path) -> Path:
    made = mcap_of(drive(), compression="", features={"ch"})
    data = bytearray(made.finish())
    begin, end = made.chunks[2]
    data[(begin + end) // 2] ^= 8
    return put(d, bytes(data))


for compression in ("zstd", "lz4"):
    table(8, f"a chunk that claims 4 GiB, {compression}", "byte", code=3)(
        lambda d, compression=compression: put(
            d, beside(chunk([message(1, 1)], size=1 << 32, compression=compression, crc=1))
        )
    )


@table(9, "zstd bomb that says so", code=3)
def _(d: Path) -> Path:
    return put(d, beside(chunk([bytes(300 << 20)], crc=0)))


@table(9, "zstd bomb that lies", code=3)
def _(d: Path) -> Path:
    return put(d, beside(chunk([bytes(300 << 20)], size=100, crc=0)))


@table(9, "lz4 bomb", code=3)
def _(d: Path) -> Path:
    return put(d, beside(chunk([bytes(300 << 20)], compression="lz4", crc=0)))


@table(9, "a .mcap.zst that is a bomb", code=1)
def _(d: Path) -> Path:
    return put(d, zstd.compress(bytes(1 << 30)), "drive.mcap.zst")


for name, record in (
    ("length 2^63", raw(5, b"abc", 1 << 63)),
    ("length 10 GB", raw(0x90, b"abc", 10 << 30)),
    ("compression of 1.7 GB", raw(6, struct.pack("<QQQII", 0, 0, 9, 0, 1_700_000_000) + b"zstd")),
    ("attachment of 2^40", raw(9, struct.pack("<QQIIQ", 0, 0, 0, 0, 1 << 40))),
    ("schema name of 4 GiB", raw(3, struct.pack("<HI", 9, (1 << 32) - 1) + b"abc")),
):
    # Attachments are not looked into, and nothing names that schema: neither costs a message.
    lost = 0 if name in ("attachment of 2^40", "schema name of 4 GiB") else 3
    made = table(10, name, code=lost, map="part" if lost else "same")
    made(lambda d, record=record: put(d, beside(record, at=2)))


# ---------------------------------------------------------------------------- 11 to 16: records

table(11, "unknown opcodes")(
    lambda d: put(d, beside(raw(0x77, b"hello"), raw(0x90, bytes(99)), raw(0xFF)))
)


@table(12, "one chunk of unknown compression", "brotli", code=3)
def _(d: Path) -> Path:
    return put(d, beside(chunk([message(1, 1, b"xy")], compression="brotli")))


@table(12, "every chunk of unknown compression", "brotli", code=1)
def _(d: Path) -> Path:
    return put(d, whole(compression="brotli"))


@table(13, "message on an unknown channel", "channel", code=3)
def _(d: Path) -> Path:
    made = mcap_of(drive())
    return put(d, made.add(r.RawMessage(77, 0, made.times[0], made.times[0], b"?")).finish())


@table(13, "channel with an unknown schema")
def _(d: Path) -> Path:
    made = mcap_of(drive())
    made.add(r.Channel(77, 88, "/odd", "cdr", {}))
    return put(d, made.add(r.RawMessage(77, 0, made.times[0], made.times[0], b"?")).finish())


@table(14, "schema id redefined", "schema")
def _(d: Path) -> Path:
    made = mcap_of(drive())
    made.add(r.Schema(1, "std_msgs/msg/String", "ros2msg", b"string data"))
    return put(d, made.finish())


def summary_damaged(d: Path, opcode: int, change: bytes, offset: int) -> Path:
    """One record of the summary changed under its CRC."""
    data = bytearray(whole())
    footer = len(data) - 8 - 29
    at = struct.unpack_from("<Q", data, footer + 9)[0]
    while data[at] != opcode:
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    data[at + 9 + offset : at + 9 + offset + len(change)] = change
    return put(d, bytes(data))


table(15, "statistics wrong", "summary")(
    lambda d: summary_damaged(d, 11, struct.pack("<Q", 1 << 60), 0)
)
table(15, "chunk index wrong", "summary")(
    lambda d: summary_damaged(d, 8, struct.pack("<Q", 1 << 40), 16)
)
table(15, "footer points nowhere", "summary")(
    lambda d: put(d, whole()[: -8 - 20] + struct.pack("<QQI", 1 << 50, 0, 0) + r.MAGIC)
)
table(15, "summary CRC wrong", "summary")(
    lambda d: put(d, whole()[: -8 - 4] + b"\1\2\3\4" + r.MAGIC)
)


def shuffled(d: Path, features: Any) -> Path:
    log = drive()
    head, rows = definitions(log)[0], messages(log)
    mixed = [row for pair in zip(rows[1::2], rows[::2], strict=False) for row in pair]
    mixed += [row for row in rows if row not in mixed]
    return put(d, McapBytes(chunk_messages=8, features=features).add(*head, *mixed).finish())


table(16, "messages out of order, with an index", quiet=True)(lambda d: shuffled(d, ALL))
table(16, "messages out of order, without one", quiet=True)(lambda d: shuffled(d, {"ch"}))
table(16, "messages out of order, no chunks", quiet=True)(lambda d: shuffled(d, set()))


# ---------------------------------------------------------------------------- 17 to 23

table(17, "junk behind the end", "behind its end")(lambda d: put(d, whole() + b"junk" * 999))


@table(17, "two files glued", "glued")
def _(d: Path) -> Path:
    log, first, second = drive(), mcap_of(drive()), mcap_of(drive())
    half = len(log.happened) // 2
    for made, part in ((first, log.happened[:half]), (second, log.happened[half:])):
        made.__init__(chunk_messages=8)
        some = replace(log, happened=part)
        made.add(*definitions(some)[0], *messages(some))
    return put(d, first.finish() + second.finish())


@table(18, "attachments with hostile names", quiet=True)
def _(d: Path) -> Path:
    names = ("../../x", "/etc/x", "CON", "a\0b", "x" * 5000)
    return put(d, whole(more=[r.Attachment(0, 0, n, "text/plain", b"pwned", 1) for n in names]))


NASTY = ("\x1b[31mred\x1b[2J", "<script>alert(1)</script>", "=cmd|'/c calc'!A1", "[red]x[/red]")


@table(19, "odd topics beside", quiet=True)
def _(d: Path) -> Path:
    made = mcap_of(drive(), more=[r.Schema(70, "std_msgs/msg/String", "ros2msg", b"string data")])
    for number, name in enumerate([*NASTY, "x" * 60_000, b"/\xff\xfe\x80"], 50):
        made.add(r.Channel(number, 70, name, "cdr", {}))  # type: ignore[arg-type]
        made.add(r.RawMessage(number, 0, made.times[0], made.times[0], b"?"))
    return put(d, made.finish())


@table(19, "the scan's topic itself is hostile", "\\x1b[31m", code=3)
def _(d: Path) -> Path:
    log = drive()
    log.happened = [
        (t, NASTY[0] if topic == "/scan" else topic, name, latched, fields)
        for t, topic, name, latched, fields in log.happened
    ]
    made = mcap_of(log)
    channel = definitions(log)[1][NASTY[0], "sensor_msgs/msg/LaserScan"]
    return put(d, made.add(r.RawMessage(channel, 0, made.times[0], made.times[0], b"?")).finish())


@table(20, "a JSON channel beside", quiet=True)
def _(d: Path) -> Path:
    made = mcap_of(drive(), more=[r.Schema(70, "x.Y", "jsonschema", b"{}")])
    made.add(r.Channel(70, 70, "/json", "json", {}))
    return put(d, made.add(r.RawMessage(70, 0, made.times[0], made.times[0], b"{}")).finish())


table(20, "profile ''", quiet=True)(lambda d: put(d, whole(profile="")))


@table(20, "a channel without a schema", quiet=True)
def _(d: Path) -> Path:
    made = mcap_of(drive()).add(r.Channel(70, 0, "/plain", "json", {}))
    return put(d, made.add(r.RawMessage(70, 0, made.times[0], made.times[0], b"{}")).finish())


table(21, "a chunk inside a chunk", "chunk inside a chunk")(
    lambda d: put(d, beside(chunk([chunk([message(1, 1)])])))
)


@table(22, "no messages", "no messages", code=1)
def _(d: Path) -> Path:
    return put(d, McapBytes().add(*definitions(drive())[0]).finish())


table(22, "nothing at all", "no messages", code=1)(lambda d: put(d, McapBytes().finish()))
table(23, ".mcap.zst", quiet=True)(lambda d: put(d, zstd.compress(whole()), "drive.mcap.zst"))
for name in ("drive", "drive.bag", "drive.png", "fährt über [x] 100%.mcap", " two  spaces ", ".x"):
    table(23, f"named {name!r}", quiet=True)(lambda d, name=name: put(d, whole(), name))
table(23, "leading dash", quiet=True)(
    lambda d: Given(options=["--", put(d, whole(), "-drive.mcap").name])
)
