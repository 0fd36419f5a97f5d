"""Walking records: rows of messages of one size are found together, and nothing else changes."""

from __future__ import annotations

import struct

from hypothesis import example, given, settings
from hypothesis import strategies as st

from formats.mcap.blocks import RUN_BYTES, WORTHWHILE, row, walk_block
from formats.mcap.records import CHANNEL, CHUNK, MESSAGE

# (opcode, size, how many in a row)
Groups = list[tuple[int, int, int]]
GROUPS = st.lists(
    st.tuples(
        st.sampled_from([MESSAGE, MESSAGE, MESSAGE, CHANNEL, CHUNK, 0]),
        st.sampled_from([0, 21, 22, 23, 40]),
        st.integers(1, 3 * WORTHWHILE),
    ),
    max_size=8,
)


def one_by_one(
    data: bytes, at: int, stop: int, enough: int
) -> tuple[list[int], list[tuple[int, int, int]], int]:
    """The obvious way."""
    messages, others, begin = [], [], at
    while at + 9 <= stop and at - begin <= enough:
        opcode, size = struct.unpack_from("<BQ", data, at)
        if at + 9 + size > stop or opcode in (0, CHUNK):
            break
        if opcode == MESSAGE and size >= 22:
            messages.append(at)
        else:
            others.append((opcode, at + 9, at + 9 + size))
        at += 9 + size
    return messages, others, at


@given(GROUPS, st.integers(0, 60), st.integers(0, 60), st.integers(0, 4000) | st.just(RUN_BYTES))
@example([(MESSAGE, 22, 100)], 0, 10, 310)
@settings(max_examples=300, deadline=None)
def test_equal_to_walking_one_by_one(groups: Groups, skip: int, cut: int, enough: int) -> None:
    data = bytes(skip)
    for opcode, size, times in groups:
        data += (struct.pack("<BQ", opcode, size) + bytes([MESSAGE] * size)) * times
    stop = max(len(data) - cut, skip)
    walked = walk_block(data, skip, stop, frozenset({CHUNK}), enough)
    assert (walked.messages.tolist(), walked.others, walked.end) == one_by_one(
        data, skip, stop, enough
    )


def test_a_row_ends_where_size_or_kind_changes() -> None:
    same = struct.pack("<BQ", MESSAGE, 30) + bytes(30)
    for other in (struct.pack("<BQ", MESSAGE, 31) + bytes(31), struct.pack("<BQ", CHANNEL, 30)):
        data = 5 * same + other + bytes(100)
        assert row(data, 0, 30, len(data) // len(same)) == 5
    assert row(5 * same, 0, 30, 5) == 5
