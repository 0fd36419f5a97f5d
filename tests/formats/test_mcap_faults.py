"""FAULTS.md's classes 1 to 23 as far as they touch MCAP, each with a file of its own."""

from __future__ import annotations

import struct
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from formats.errors import FormatError, Notes
from formats.mcap import records as r
from formats.mcap.log import McapLog, fits, open_file
from tests.mcap_files import ALL, McapBytes, chunk, compress, encode, message, raw, scan_definitions

MIB = 1 << 20
GIB = 1 << 30


def opened(folder: Path, data: bytes) -> tuple[McapLog, Notes, list[int]]:
    """The log, its notes, and the times of its messages."""
    path = folder / "log.mcap"
    path.write_bytes(data)
    notes = Notes()
    log = open_file(path, notes)
    return log, notes, [message.time_ns for message in log.messages()]


def ten_chunks(**options: object) -> McapBytes:
    """Times 0 to 99 on /scan1, ten to a chunk."""
    file = McapBytes(**options).add(*scan_definitions(1))  # type: ignore[arg-type]
    return file.messages(1, range(100))


def amid(*records: bytes) -> bytes:
    """Times 0 to 9 in a chunk, these records, and times 20 to 29 in a chunk; with a summary."""
    file = McapBytes().add(*scan_definitions(1)).messages(1, range(10))
    file.close_chunk()
    for record in records:
        file.out += record
    return file.messages(1, range(20, 30)).finish()


AROUND = [*range(10), *range(20, 30)]


def said(notes: Notes) -> list[tuple[str, int]]:
    return [(f"{note.kind}: {note.problem}", note.count) for note in notes]


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"", "is empty"),
        (r.MAGIC, "holds no records"),
        (b"\x89PNG\r\n\x1a\n" + bytes(100), "is not an MCAP file"),
        (b"just some text\n" * 10, "is not an MCAP file"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n", "git lfs pull"),
        (b"\x89MCAP1\r\n" + bytes(100), "MCAP version 1"),
    ],
)
def test_1_to_3_other_files_are_refused_by_what_they_are(
    data: bytes, problem: str, tmp_path: Path
) -> None:
    with pytest.raises(FormatError, match=problem):
        opened(tmp_path, data)


def test_3_another_version_is_taken_as_mcap_to_be_refused() -> None:
    assert fits(Path("x"), b"\x89MCAP1\r\n")


def test_missing_file_and_folder_are_one_line(tmp_path: Path) -> None:
    for path in (tmp_path / "no.mcap", tmp_path):
        with pytest.raises(FormatError, match="cannot be read"):
            open_file(path, Notes())


@pytest.mark.parametrize("compression", ["", "zstd", "lz4"])
def test_4_power_loss_in_a_chunk(compression: str, tmp_path: Path) -> None:
    file = ten_chunks(compression=compression)
    begin, end = file.chunks[7]
    for cut in (begin + 5, begin + 30, begin + 50, (begin + end) // 2, end - 1):
        log, notes, times = opened(tmp_path, bytes(file.out[:cut]))
        assert times[:70] == list(range(70))
        assert times == list(range(len(times)))  # and perhaps some of the cut chunk
        if compression == "" and cut == end - 1:
            assert len(times) == 79
        (note,) = notes.of("lost")
        assert note.problem == "cut in a chunk"
        assert note.at.startswith(f"byte {begin}, ")
        assert note.at.endswith("s after its start")
        assert log.container.state == f"cut at byte {begin}"
        assert not log.container.whole


def test_5_cut_behind_the_data_loses_nothing(tmp_path: Path) -> None:
    file = ten_chunks()
    behind = file.chunks[-1][1]
    data = file.finish()
    for size in [*range(behind, len(data), 7), len(data) - 8, len(data) - 1]:
        log, notes, times = opened(tmp_path, data[:size])
        assert times == list(range(100))
        assert [note.kind for note in notes] == ["warning"], (size, said(notes))
        assert not log.container.whole


@pytest.mark.parametrize("missing", ["sum", "ch", "chx", "mx", "st", "rch", "rsh", "all"])
@pytest.mark.parametrize("crcs", [True, False])
def test_6_what_the_standard_leaves_optional_may_be_missing(
    missing: str, crcs: bool, tmp_path: Path
) -> None:
    features = set() if missing == "all" else ALL - {missing}
    file = ten_chunks(features=features, chunk_crc=crcs, data_crc=crcs, summary_crc=crcs)
    log, notes, times = opened(tmp_path, file.finish())
    assert times == list(range(100))
    assert not list(notes)
    assert log.container.whole


@pytest.mark.parametrize("linear", [True, False])
@pytest.mark.parametrize("compression", ["", "zstd", "lz4"])
def test_7_a_chunk_with_a_wrong_crc_is_skipped_and_counted(
    linear: bool, compression: str, tmp_path: Path
) -> None:
    file = ten_chunks(compression=compression, summary_crc=not linear)
    data = bytearray(file.finish())
    begin, end = file.chunks[4]
    data[(begin + 60 + end) // 2] ^= 4
    log, notes, times = opened(tmp_path, bytes(data))
    assert times == [*range(40), *range(50, 100)]
    (note,) = notes
    assert (note.kind, note.topic, note.count) == ("lost", "/scan1", 10)
    assert note.problem == "chunk whose CRC does not match: messages lost"
    assert note.at == f"byte {begin}"
    assert log.container.state == f"damaged at byte {begin}"
    list(log.messages())
    assert notes.total("lost") == 10


def test_7_bit_rot_without_chunk_crc_shows_in_the_data_crc(tmp_path: Path) -> None:
    file = ten_chunks(features=ALL - {"ch"})
    data = bytearray(file.finish())
    data[data.index(b"\x5a" * 10)] ^= 1
    log, notes, times = opened(tmp_path, bytes(data))
    assert times == list(range(100))
    assert said(notes) == [
        ("lost: the data section's CRC does not match: some message is damaged", 1)
    ]
    assert not log.container.whole


def peak_of(job: Callable[[], object]) -> int:
    tracemalloc.start()
    job()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


@pytest.mark.parametrize("size", [4 * GIB, 2**63, 2**64 - 1, 0, 1])
def test_8_a_chunk_that_lies_about_its_size(size: int, tmp_path: Path) -> None:
    inner = [message(1, 15, bytes(100))]
    truth = b"".join(inner)
    lie = encode(r.Chunk(15, 15, size, 12345, "zstd", compress("zstd", truth)))
    data = amid(lie)

    def job() -> None:
        _, notes, times = opened(tmp_path, data)
        assert times == AROUND
        assert notes.total("lost") == 1

    assert peak_of(job) < 20 * MIB


def test_8_a_sound_chunk_with_a_wrong_size_is_used(tmp_path: Path) -> None:
    _, notes, times = opened(tmp_path, amid(chunk([message(1, 15)], size=4 * GIB)))
    assert times == sorted([*AROUND, 15])
    assert said(notes) == [("warning: chunk of another size than it says", 1)]


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
@pytest.mark.parametrize("claim", [100, 60 * MIB, 60 * GIB])
def test_9_bombs_stop_at_the_limit(compression: str, claim: int, tmp_path: Path) -> None:
    packed = compress(compression, bytes(60 * MIB))
    path = tmp_path / "log.mcap"
    path.write_bytes(amid(encode(r.Chunk(0, 0, claim, 0, compression, packed))))

    def job() -> None:
        notes = Notes()
        log = open_file(path, notes, max_chunk=4 * MIB)
        assert [m.time_ns for m in log.messages()] == AROUND
        assert notes.total("lost") == 1

    begin = time.process_time()
    assert peak_of(job) < 30 * MIB
    assert time.process_time() - begin < 10


def test_9_a_larger_limit_reads_a_large_chunk(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(amid(chunk([message(1, 15, bytes(5 * MIB))])))
    for limit, expected in ((4 * MIB, AROUND), (6 * MIB, sorted([*AROUND, 15]))):
        notes = Notes()
        times = [m.time_ns for m in open_file(path, notes, max_chunk=limit).messages()]
        assert times == expected
        assert notes.total("lost") == (limit == 4 * MIB)
        assert all("--max-chunk" in note.problem for note in notes)


@pytest.mark.parametrize(
    "trap",
    [bytes(40 * MIB), raw(5) * (2 * MIB), raw(0x90) * (2 * MIB), raw(0x20) * (2 * MIB)],
    ids=["opcode 0", "empty messages", "empty extensions", "empty unknown records"],
)
def test_9_traps_of_empty_records_end_soon(trap: bytes, tmp_path: Path) -> None:
    begin = time.process_time()
    _, notes, times = opened(tmp_path, amid(chunk([message(1, 15), trap])))
    assert times == sorted([*AROUND, 15])
    assert notes.total("lost") > 0
    assert time.process_time() - begin < 20


ATTACHMENT = struct.pack("<QQ", 0, 0) + b"\1\0\0\0a\1\0\0\0b"


@pytest.mark.parametrize(
    "record",
    [
        raw(r.MESSAGE, bytes(30), length=2**63),
        raw(r.CHUNK, bytes(60), length=10 * GIB),
        raw(r.CHUNK, struct.pack("<QQQII", 0, 0, 0, 0, 1_700_000_000) + b"zstd" * 9),
        raw(r.CHUNK, struct.pack("<QQQII", 0, 0, 0, 0, 4) + b"zstd" + b"\xff" * 8),
        raw(r.ATTACHMENT, ATTACHMENT, length=2**40),
        raw(r.CHANNEL, b"\1\0\1\0\xff\xff\xff\x7f/scan"),
        raw(0, bytes(50), length=0),
        b"\xff" * 100,
    ],
)
def test_10_lengths_are_bounded_by_what_is_there(record: bytes, tmp_path: Path) -> None:
    def job() -> None:
        _, notes, times = opened(tmp_path, amid(record))
        assert times == AROUND
        assert notes.total("lost") + notes.total("warning") >= 1

    assert peak_of(job) < 20 * MIB


def test_10_an_attachment_of_2_to_the_40(tmp_path: Path) -> None:
    record = raw(r.ATTACHMENT, ATTACHMENT + struct.pack("<Q", 2**40) + bytes(20))
    log, notes, times = opened(tmp_path, amid(record))
    assert times == AROUND
    assert list(log.attachments()) == []
    assert said(notes) == [("lost: damaged attachment", 1)]


def test_11_unknown_opcodes_are_skipped(tmp_path: Path) -> None:
    odd = chunk([raw(0x81, b"abc"), raw(0x10, b"abc"), message(1, 15)])
    _, notes, times = opened(tmp_path, amid(raw(0xFF, b"x" * 50), odd))
    assert times == sorted([*AROUND, 15])
    assert said(notes) == [("warning: record of unknown kind 16 skipped", 1)]


def test_12_unknown_compression_is_one_line(tmp_path: Path) -> None:
    bad = chunk([message(1, 15)], compression="br\x1bot")
    _, notes, times = opened(tmp_path, amid(bad, bad))
    assert times == AROUND
    assert said(notes) == [("lost: chunk with unknown compression 'br\x1bot'", 2)]


@pytest.mark.parametrize("inside", [True, False])
def test_13_messages_on_unknown_channels_are_counted(inside: bool, tmp_path: Path) -> None:
    odd = message(9, 15) + message(9, 16)
    _, notes, times = opened(tmp_path, amid(chunk([odd]) if inside else odd))
    assert times == AROUND
    assert said(notes) == [("lost: messages on channels that are not defined", 2)]


def test_13_unknown_channels_under_a_sound_index_are_counted(tmp_path: Path) -> None:
    file = ten_chunks()
    file.messages(7, [200]).close_chunk()
    file.counts[7] = 0
    del file.counts[7]
    _, notes, times = opened(tmp_path, file.finish())
    assert times == list(range(100))
    assert said(notes) == [("lost: messages on channels that are not defined", 1)]


def test_13_a_channel_with_an_unknown_schema_is_read(tmp_path: Path) -> None:
    log, notes, times = opened(
        tmp_path, amid(encode(r.Channel(5, 77, "/odd", "cdr", {})), message(5, 15))
    )
    assert times == sorted([*AROUND, 15])
    assert [(topic.name, topic.type) for topic in log.topics()[:1]] == [("/odd", "")]
    assert said(notes) == [("warning: schema 77 is not defined; its type is unknown", 1)]


def test_14_the_first_definition_of_an_id_holds(tmp_path: Path) -> None:
    log, notes, times = opened(
        tmp_path,
        amid(
            encode(r.Schema(1, "other/msg/Type", "ros2msg", b"")),
            chunk([encode(r.Channel(1, 1, "/other", "cdr", {})), message(1, 15)]),
        ),
    )
    assert times == sorted([*AROUND, 15])
    assert [(t.name, t.type) for t in log.topics()] == [("/scan1", "sensor_msgs/msg/LaserScan")]
    assert said(notes) == [
        ("warning: schema redefined; the first definition of an id holds", 1),
        ("warning: channel redefined; the first definition of an id holds", 1),
    ]


def test_15_a_damaged_summary_is_not_believed(tmp_path: Path) -> None:
    file = ten_chunks()
    behind = file.chunks[-1][1]
    data = file.finish()
    for at in range(behind, len(data) - 8, 7):
        damaged = bytearray(data)
        damaged[at] ^= 0x11
        log, notes, times = opened(tmp_path, bytes(damaged))
        assert times == list(range(100)), at
        assert notes.total("lost") == 0, (at, said(notes))
        assert [(topic.name, topic.count) for topic in log.topics()] == [("/scan1", 100)]


def test_15_wrong_statistics_and_index_under_a_sound_crc(tmp_path: Path) -> None:
    fewer = ten_chunks()
    fewer.counts[1] = 90  # the statistics of a writer that counts wrongly
    log, notes, times = opened(tmp_path, fewer.finish())
    assert times == list(range(100))
    shifted = ten_chunks()
    shifted.close_chunk()
    index = shifted.indexes[8]
    index[3], index[4] = index[3][:30] + bytes(8) + index[3][38:], index[4]
    log, notes, times = opened(tmp_path, shifted.finish())
    assert times == list(range(100))
    assert not notes.of("lost")
    assert log.container.whole


def test_17_junk_behind_the_end(tmp_path: Path) -> None:
    data = ten_chunks().finish()
    for junk in (b"\0", b"junk" * 1000, bytes(5000)):
        log, notes, times = opened(tmp_path, data + junk)
        assert times == list(range(100))
        assert said(notes) == [("warning: bytes behind its end", 1)]
        assert log.container.whole


def test_17_two_files_glued_whose_ids_mean_different_things(tmp_path: Path) -> None:
    first = McapBytes(profile="ros2").add(*scan_definitions(1)).messages(1, [1, 3, 5]).finish()
    second = (
        McapBytes(profile="ros1")
        .add(r.Schema(1, "a/B", "ros1msg", b""), r.Channel(1, 1, "/b", "ros1", {}))
        .messages(1, [2, 4, 6])
        .finish()
    )
    for glue in (b"", b"junk"):
        log, notes, times = opened(tmp_path, first + glue + second)
        assert times == [1, 2, 3, 4, 5, 6]
        assert [(t.name, t.type, t.encoding, t.count) for t in log.topics()] == [
            ("/b", "a/msg/B", "ros1", 3),
            ("/scan1", "sensor_msgs/msg/LaserScan", "cdr", 3),
        ]
        assert "another file is glued to its end" in str(said(notes))
        assert not notes.of("lost")
        assert [m.topic.name for m in log.messages()] == ["/scan1", "/b"] * 3


def test_17_a_file_glued_to_a_cut_one(tmp_path: Path) -> None:
    file = ten_chunks(compression="")
    other = McapBytes().add(*scan_definitions(1)).messages(1, range(500, 510)).finish()
    begin, _ = file.chunks[6]
    _, notes, times = opened(tmp_path, bytes(file.out[:begin]) + other)
    assert times == [*range(60), *range(500, 510)]
    assert said(notes)[0] == ("warning: another file begins inside", 1)


@pytest.mark.parametrize("name", [b"/\xff\xfe", b"/\x1b[31mred", b"/<script>", b"/" + b"x" * 60000])
def test_19_odd_topic_names(name: bytes, tmp_path: Path) -> None:
    channel = raw(r.CHANNEL, b"\5\0\1\0" + struct.pack("<I", len(name)) + name + bytes(8))
    log, notes, times = opened(tmp_path, amid(channel, message(5, 15)))
    assert times == sorted([*AROUND, 15])
    names = [topic.name for topic in log.topics()]
    assert names[0].encode().startswith(name[:1])
    assert len(names) == 2
    assert not list(notes)


def test_19_odd_names_are_printable_in_notes(tmp_path: Path) -> None:
    name = b"/\x1b[31m" + b"x" * 60000
    channel = raw(r.CHANNEL, b"\5\0\7\0" + struct.pack("<I", len(name)) + name + bytes(8))
    _, notes, _ = opened(tmp_path, amid(channel, message(5, 15)))
    (line,) = [str(note) for note in notes]
    assert "\x1b" not in line
    assert len(line) < 600


def test_21_a_chunk_in_a_chunk_is_skipped(tmp_path: Path) -> None:
    nested = chunk([chunk([message(1, 14)]), message(1, 15)])
    _, notes, times = opened(tmp_path, amid(nested))
    assert times == sorted([*AROUND, 15])
    assert said(notes) == [("warning: chunk inside a chunk skipped", 1)]


def test_22_no_messages(tmp_path: Path) -> None:
    log, notes, times = opened(tmp_path, McapBytes().add(*scan_definitions(1)).finish())
    assert times == []
    assert [(topic.name, topic.count) for topic in log.topics()] == [("/scan1", 0)]
    assert (log.container.start_ns, log.container.end_ns) == (0, 0)
    assert not list(notes)


def test_unchunked_messages_with_damaged_lengths_cost_only_themselves(tmp_path: Path) -> None:
    file = McapBytes(features=set(), data_crc=False).add(*scan_definitions(1))
    places = []
    for number in range(60):
        places.append(len(file.out))
        file.messages(1, [number], size=40 + number % 7)
    data = file.finish()
    for number in range(5, 55, 7):
        for flip in (0x01, 0x10, 0x80):
            for byte in range(1, 9):
                damaged = bytearray(data)
                damaged[places[number] + byte] ^= flip
                _, notes, times = opened(tmp_path, bytes(damaged))
                expected = [time for time in range(60) if time != number]
                assert [t for t in times if t != number] == expected, (number, flip, byte)
                assert notes.total("lost") >= 1


def test_damage_between_chunks_is_stepped_over(tmp_path: Path) -> None:
    for summary_crc in (True, False):
        file = ten_chunks(summary_crc=summary_crc)
        data = bytearray(file.finish())
        data[file.chunks[3][1] + 2 : file.chunks[3][1] + 12] = b"\xee" * 10  # the message index
        log, _, times = opened(tmp_path, bytes(data))
        assert times == list(range(100))
        assert not log.container.whole
