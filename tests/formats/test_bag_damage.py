"""Cut and damaged ROS 1 bags: everything that is there, every loss counted."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from formats.errors import FormatError
from tests.bag_files import (
    Bag,
    drive,
    make_bag,
    read_bag,
    spoil,
    told,
    u32,
)

KINDS = ["none", "lz4", "bz2"]


def test_unindexed_bag_is_read_in_full(tmp_path: Path) -> None:
    messages = drive()
    for kind in KINDS:
        found, notes = read_bag(
            tmp_path / "x.bag.active", make_bag(messages, kind, index=False).raw
        )
        assert found == messages
        assert [note.kind for note in notes] == ["warning"]
        assert "no index" in notes.of("warning")[0].problem


def there(made: Bag, cut: int, kind: str) -> int:
    """Messages whose bytes lie before a cut, by the codec's own blocks."""
    whole = [place for place in made.chunks if place.end <= cut]
    count = sum(len(place.messages) for place in whole)
    for place in made.chunks[len(whole) : len(whole) + 1]:
        readable = 0
        if kind == "none":
            readable = cut - place.data
        elif kind == "lz4":  # blocks of 64 kB, each behind its size; a bz2 block holds 900 kB
            pos = place.data + 7
            while pos + 4 <= cut:
                size = struct.unpack_from("<I", made.raw, pos)[0] & 0x7FFFFFFF
                pos += 4 + size
                readable += 65536 * (size > 0 and pos <= cut)
        count += sum(1 for _, end in place.offsets if end <= readable)
    return count


@pytest.mark.parametrize("kind", KINDS)
def test_cut_anywhere(tmp_path: Path, kind: str) -> None:
    """54 even cuts of a bag of 300-kB chunks: everything that is there, and the loss is told."""
    messages = drive(1_200, 2_000)
    made = make_bag(messages, kind, 300_000)
    physically = got = 0
    for step in range(1, 55):
        cut = len(made.raw) * step // 55
        try:
            found, notes = read_bag(tmp_path / "x.bag", made.raw[:cut])
        except FormatError:
            assert there(made, cut, kind) == 0
            continue
        assert found == messages[: len(found)]
        assert cut >= made.index_pos or notes.of("lost")
        assert len(found) >= there(made, cut, kind)
        physically += there(made, cut, kind)
        got += len(found)
    assert physically > 20_000
    assert got >= physically  # 98 % was asked for


def test_cut_inside_the_index_loses_nothing(tmp_path: Path) -> None:
    messages = drive()
    made = make_bag(messages)
    for cut in (made.index_pos, made.index_pos + 50, len(made.raw) - 3):
        found, notes = read_bag(tmp_path / "x.bag", made.raw[:cut])
        assert found == messages
        assert not notes.of("lost")
        assert len(notes.of("warning")) <= 2


def test_cut_inside_the_bag_header(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no readable record"):
        read_bag(tmp_path / "x.bag", make_bag(drive()).raw[:1_000])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("index", [True, False])
def test_damaged_chunk_header(tmp_path: Path, kind: str, index: bool) -> None:
    """The messages behind it are found by their own records, or by the compression's magic."""
    messages = drive()
    made = make_bag(messages, kind, index=index)
    raw = spoil(made.raw, made.chunks[2].pos + 4, b"\xff" * 8)
    found, notes = read_bag(tmp_path / "x.bag", raw)
    assert found == messages
    assert set(told(notes)) & {"damaged bytes between records", "damaged chunk"}


@pytest.mark.parametrize("kind", ["lz4", "bz2"])
@pytest.mark.parametrize("index", [True, False])
def test_a_chunk_that_is_gone_is_counted_by_topic(tmp_path: Path, kind: str, index: bool) -> None:
    messages = drive()
    made = make_bag(messages, kind, index=index)
    place = made.chunks[2]
    raw = spoil(made.raw, place.pos, bytes(place.end - place.pos))
    found, notes = read_bag(tmp_path / "x.bag", raw)
    assert found == [m for m in messages if m not in place.messages]
    lost = {note.topic: note.count for note in notes.of("lost") if note.topic}
    assert lost == {
        name: sum(m[0] == name for m in place.messages) for name in ("/scan", "/odom", "/tf")
    }


@pytest.mark.parametrize("index", [True, False])
@pytest.mark.parametrize("length", [0, 50, 300, 1_000, 2_000, 2**31, 2**32 - 1])
def test_damaged_message_length_costs_that_message(
    tmp_path: Path, index: bool, length: int
) -> None:
    messages = drive()
    made = make_bag(messages, index=index)
    start = made.chunks[1].data + made.chunks[1].offsets[5][0]
    raw = spoil(made.raw, start + 42, u32(length))
    found, notes = read_bag(tmp_path / "x.bag", raw)
    bad = made.chunks[1].messages[5]
    assert found == [m for m in messages if m is not bad]
    assert [(note.topic, note.count) for note in notes.of("lost")] == [(bad[0], 1)]


@pytest.mark.parametrize("index", [True, False])
def test_damaged_message_header_costs_that_message(tmp_path: Path, index: bool) -> None:
    messages = drive()
    made = make_bag(messages, index=index)
    start = made.chunks[1].data + made.chunks[1].offsets[5][0]
    found, notes = read_bag(tmp_path / "x.bag", spoil(made.raw, start + 8, b"XXXX"))
    bad = made.chunks[1].messages[5]
    assert found == [m for m in messages if m is not bad]
    assert notes.total("lost") == 1
    assert not index or notes.of("lost")[0].topic == bad[0]


def test_index_and_message_disagree_on_the_time(tmp_path: Path) -> None:
    messages = drive()
    made = make_bag(messages)
    place = made.chunks[1]
    start = place.data + place.offsets[5][0]
    for pos, new in ((start + 34, u32(1)), (start + 38, u32(999_999_999))):
        found, notes = read_bag(tmp_path / "x.bag", spoil(made.raw, pos, new))
        assert [t for _, t, _ in found] == sorted(t for _, t, _ in found)
        assert sorted(d for _, _, d in found) == sorted(d for _, _, d in messages)
        assert "index and messages disagree" in told(notes)


def test_damaged_index_entries(tmp_path: Path) -> None:
    """Every byte of one index record spoilt in turn: nothing is lost, and something is said."""
    messages = drive(60)
    made = make_bag(messages, chunk=6_000)
    place = made.chunks[1]
    entry = 4 + 47 + 4  # where the index record's entries begin
    for pos in range(place.end, place.end + entry + 24):
        raw = spoil(made.raw, pos, bytes([made.raw[pos] ^ 0x55]))
        found, notes = read_bag(tmp_path / "x.bag", raw)
        assert found == messages, pos - place.end
        assert not notes.of("lost"), pos - place.end


def test_lengths_of_4_gib_are_bounded(tmp_path: Path) -> None:
    messages = drive()
    for kind in KINDS:
        made = make_bag(messages, kind)
        place = made.chunks[2]
        size_field = made.raw.index(b"size=", place.pos) + 5
        for pos in (place.pos, place.data - 4, size_field, 13, made.raw.index(b"conn_count=") + 11):
            found, notes = read_bag(tmp_path / "x.bag", spoil(made.raw, pos, b"\xff\xff\xff\xff"))
            assert found == messages, (kind, pos)
            assert list(notes), (kind, pos)


SOUND = {kind: make_bag(drive(90, 300), kind, 6_000) for kind in KINDS}
BARE = {kind: make_bag(drive(90, 300), kind, 6_000, index=False) for kind in KINDS}


def check_damage(path: Path, kind: str, index: bool, flips: list[tuple[int, int]]) -> None:
    """The same, an error of ours, or something said; never more than there was.

    What no bag can show is left out: a changed payload where the compression has no checksum, and
    text of a connection that is recorded once.
    """
    made = (SOUND if index else BARE)[kind]
    raw = bytearray(made.raw)
    for place, value in flips:
        raw[place % len(raw)] ^= value
    before = drive(90, 300)
    try:
        found, notes = read_bag(path, bytes(raw))
    except FormatError:
        return
    said = notes.of("lost") + notes.of("warning")
    assert [time for _, time, _ in found] == sorted(time for _, time, _ in found)
    assert len(found) <= len(before)
    if not said:
        assert len(found) == len(before)
        if index:
            assert [time for _, time, _ in found] == [time for _, time, _ in before]
        if kind != "none":
            assert [data for _, _, data in found] == [data for _, _, data in before]


flips = st.lists(st.tuples(st.integers(0, 10**6), st.integers(1, 255)), min_size=1, max_size=4)


@given(st.sampled_from(KINDS), st.booleans(), flips)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_random_damage(
    tmp_path_factory: pytest.TempPathFactory, kind: str, index: bool, flips: list[tuple[int, int]]
) -> None:
    check_damage(tmp_path_factory.getbasetemp() / "damaged.bag", kind, index, flips)


@pytest.mark.slow
@given(st.sampled_from(KINDS), st.booleans(), flips)
@settings(max_examples=2_000, deadline=None)
def test_random_damage_at_length(
    tmp_path_factory: pytest.TempPathFactory, kind: str, index: bool, flips: list[tuple[int, int]]
) -> None:
    check_damage(tmp_path_factory.getbasetemp() / "damaged.bag", kind, index, flips)
