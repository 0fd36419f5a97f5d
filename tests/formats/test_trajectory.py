"""TUM trajectories: to the nanosecond, to the bit, and with the line of every fault."""

from __future__ import annotations

from math import cos, pi, sin
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from formats.errors import FormatError, Notes
from formats.frame import Pose
from formats.trajectory import read_tum, seconds, write_tum

NS = st.integers(0, 4 * 10**18)
METRES = st.floats(-1e6, 1e6)


def test_a_line_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "a.tum"
    write_tum(path, [1_664_000_000_123_456_789], [Pose(1.5, -2.25, pi / 2)], comment="two\nlines")
    comment, header, line = path.read_text().splitlines()
    assert comment == r"# two\nlines"
    assert header.startswith("#")
    half = repr(sin(pi / 4)), repr(cos(pi / 4))
    assert line == f"1664000000.123456789 1.5 -2.25 0.0 0.0 0.0 {half[0]} {half[1]}"


@given(st.lists(st.tuples(NS, METRES, METRES, st.floats(-pi, pi)), min_size=1, max_size=20))
def test_round_trip(tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[int, ...]]) -> None:
    rows.sort()
    path = tmp_path_factory.mktemp("tum") / "a.tum"
    write_tum(path, [row[0] for row in rows], [Pose(*row[1:]) for row in rows])
    read = read_tum(path)
    assert read.times_ns.tolist() == [row[0] for row in rows]
    assert read.numbers[:, :2].tolist() == [list(row[1:3]) for row in rows]
    turned = np.exp(1j * (read.planar()[:, 2] - [row[3] for row in rows]))
    assert np.allclose(turned, 1.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("word", "time_ns"),
    [
        ("1.5", 1_500_000_000),
        ("1305031098.665900000000000000e+00", 1_305_031_098_665_900_000),
        ("1.664000000123456789e+09", 1_664_000_000_123_456_789),  # as numpy.savetxt writes it
        ("-0.000000001", -1),
        ("7", 7_000_000_000),
        ("0.0000000004", 0),
    ],
)
def test_times_are_decimal_numbers(tmp_path: Path, word: str, time_ns: int) -> None:
    path = tmp_path / "a.tum"
    path.write_text(f"{word} 0 0 0 0 0 0 1\n")
    assert read_tum(path).times_ns.tolist() == [time_ns]


def test_seconds_below_zero() -> None:
    assert seconds(-1_500_000_000) == "-1.500000000"


def test_comments_blank_lines_and_tabs_are_fine(tmp_path: Path) -> None:
    path = tmp_path / "a.tum"
    path.write_bytes(b"\xef\xbb\xbf# made by hand\r\n\r\n 1 2\t3 4  0 0 0 1 \r\n#\r\n")
    read = read_tum(path)
    assert read.numbers.tolist() == [[2, 3, 4, 0, 0, 0, 1]]


def test_yaw_of_a_tilted_pose(tmp_path: Path) -> None:
    # roll 0.3 about x, then yaw 1.2 about z: q = qz * qx, by hand
    c, s, d, r = cos(0.6), sin(0.6), cos(0.15), sin(0.15)
    path = tmp_path / "a.tum"
    path.write_text(f"0 0 0 0 {c * r} {s * r} {s * d} {c * d}\n")
    assert read_tum(path).planar()[0, 2] == pytest.approx(1.2, abs=1e-12)


def test_lines_out_of_order_are_sorted_and_quaternions_normalised(tmp_path: Path) -> None:
    path, notes = tmp_path / "a.tum", Notes()
    path.write_text("2 1 0 0 0 0 0 1\n1 2 0 0 0 0 0 1.1\n3 3 0 0 0 0 0 1\n0 4 0 0 0 0 0 1.001\n")
    read = read_tum(path, notes)
    assert read.times_ns.tolist() == [0, 10**9, 2 * 10**9, 3 * 10**9]
    assert read.numbers[:, 0].tolist() == [4, 2, 1, 3]
    assert np.allclose(np.linalg.norm(read.numbers[:, 3:], axis=1), 1.0)
    said = [str(note) for note in notes]
    assert any("2 x line out of time order, sorted (first at line 2)" in each for each in said)
    assert any("quaternion normalised at line 2" in each for each in said)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no poses"),
        ("# nothing\n", "no poses"),
        ("1 2 3\n", "3 words where t x y z qx qy qz qw are 8 at line 1"),
        ("1,2,3,4,5,6,7,8\n", "1 words .* at line 1; words stand apart by spaces"),
        ("#\n1 0 0 0 0 0 0 1\n2 0 0 0 0 0 x 1\n", "not a pose: 2 0 0 0 0 0 x 1 at line 3"),
        ("1 0 0 0 0 0 0 nan\n", "not a pose"),
        ("1 inf 0 0 0 0 0 1\n", "not a pose"),
        ("nan 0 0 0 0 0 0 1\n", "not a pose"),
        ("1e999999999 0 0 0 0 0 0 1\n", "not a pose"),
        ("1 0 0 0 0 0 0 0\n", "a quaternion of zeros at line 1"),
        ("\x1b[31m 0 0 0 0 0 0 0\n", r"not a pose: \\x1b\[31m"),
        ("1" * 5000, "not so long at line 1"),
    ],
)
def test_faults_name_the_line(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "a.tum"
    path.write_text(text)
    with pytest.raises(FormatError, match=says) as caught:
        read_tum(path)
    assert "\n" not in str(caught.value)


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="No such file"):
        read_tum(tmp_path / "none.tum")
