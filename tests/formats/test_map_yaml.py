"""Map yamls: what ROS 1 and nav2 read is read; every fault is one line with its place."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
import yaml as pyyaml
from hypothesis import given
from hypothesis import strategies as st

from formats.errors import FormatError, Notes
from formats.frame import Pose
from formats.plans.map_yaml import KEYS, MapYaml, read_map_yaml

GOOD = """\
image: map.pgm
resolution: 0.05
origin: [-10.0, 2.5, 0.1]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def read(text: str | bytes, *, picture: bool = False, notes: Notes | None = None) -> MapYaml:
    data = text.encode() if isinstance(text, str) else text
    return read_map_yaml("map.yaml", data, notes or Notes(), picture=picture)


def changed(key: str, value: str) -> str:
    """The good yaml with the value of one key as given; "" leaves the key out."""
    lines = [line for line in GOOD.splitlines() if not line.startswith(f"{key}:")]
    at = [line.split(":")[0] for line in GOOD.splitlines()].index(key)
    if value:
        lines.insert(at, f"{key}: {value}")
    return "\n".join(lines) + "\n"


def test_a_good_one() -> None:
    wanted = MapYaml("map.pgm", 0.05, Pose(-10.0, 2.5, 0.1), False, 0.65, 0.196, "trinary")
    assert read(GOOD) == wanted


@pytest.mark.parametrize(
    ("key", "value", "field", "wanted"),
    [
        ("resolution", "5e-2", "resolution", 0.05),  # text in YAML 1.1, a number to yaml-cpp
        ("resolution", "'0.05'", "resolution", 0.05),
        ("resolution", ".05", "resolution", 0.05),
        ("resolution", "1", "resolution", 1.0),
        ("origin", "[-1, 2, 3]", "origin", Pose(-1.0, 2.0, 3.0)),
        ("origin", "\n- 1.0\n- 2.0\n- 0.0", "origin", Pose(1.0, 2.0, 0.0)),
        ("negate", "1", "negate", True),
        ("negate", "true", "negate", True),
        ("negate", "False", "negate", False),
        ("free_thresh", "0.25", "free_thresh", 0.25),
        ("free_thresh", "0", "free_thresh", 0.0),
        ("occupied_thresh", "1.0", "occupied_thresh", 1.0),
        ("image", "'a b: c.pgm'", "image", "a b: c.pgm"),
        ("image", "/tmp/ä.png", "image", "/tmp/ä.png"),
    ],
)
def test_values(key: str, value: str, field: str, wanted: object) -> None:
    assert getattr(read(changed(key, value)), field) == wanted


@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
def test_modes(mode: str) -> None:
    assert read(GOOD + f"mode: {mode}\n").mode == mode


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_byte_order_marks_and_line_ends(encoding: str, ends: str) -> None:
    assert read(GOOD.replace("\n", ends).encode(encoding)) == read(GOOD)


def test_a_mark_does_not_shift_the_column() -> None:
    text = "image : [\n"
    with pytest.raises(FormatError) as plain:
        read(text)
    with pytest.raises(FormatError) as marked:
        read(text.encode("utf-8-sig"))
    assert str(plain.value) == str(marked.value)


# (what, yaml, how the one line begins, words in it)
FAULTS: list[tuple[str, str | bytes, str, str]] = [
    ("thresholds crossed", changed("free_thresh", "0.7"), ":6:14:", "not below occupied_thresh"),
    ("thresholds equal", changed("free_thresh", "0.65"), ":6:14:", "not below occupied_thresh"),
    ("threshold in per cent", changed("occupied_thresh", "65"), ":5:18:", "0 to 1, not 65"),
    ("threshold negative", changed("free_thresh", "-0.1"), ":6:14:", "0 to 1, not -0.1"),
    ("threshold is nan", changed("free_thresh", ".nan"), ":6:14:", "not a finite number"),
    ("mode unknown", GOOD + "mode: foo\n", ":7:7:", "mode 'foo' is unknown; one of trinary"),
    ("mode in capitals", GOOD + "mode: Trinary\n", ":7:7:", "'Trinary' is unknown"),
    ("mode a list", GOOD + "mode: [raw]\n", ":7:7:", "must be one value"),
    ("origin of 2", changed("origin", "[1, 2]"), ":3:9:", "3 elements [x, y, yaw], not 2"),
    ("origin of 4", changed("origin", "[1, 2, 3, 4]"), ":3:9:", "not 4"),
    ("origin a number", changed("origin", "1"), ":3:9:", "must be a list"),
    ("origin a mapping", changed("origin", "{x: 1}"), ":3:9:", "must be a list"),
    ("origin with nan", changed("origin", "[1, .nan, 0]"), ":3:13:", "is .nan, not a finite"),
    ("origin with text", changed("origin", "[1, 2, north]"), ":3:16:", "number, not 'north'"),
    ("origin nested", changed("origin", "[1, [2], 0]"), ":3:13:", "must be one value"),
    ("resolution 0", changed("resolution", "0"), ":2:13:", "must be positive, not 0"),
    ("resolution negative", changed("resolution", "-0.05"), ":2:13:", "positive, not -0.05"),
    ("resolution nan", changed("resolution", ".nan"), ":2:13:", "not a finite number"),
    ("resolution inf", changed("resolution", ".inf"), ":2:13:", "not a finite number"),
    ("resolution overflows", changed("resolution", "1e999"), ":2:13:", "must be a number"),
    ("resolution tiny", changed("resolution", "1e-300"), ":2:13:", "beyond reason"),
    ("resolution huge", changed("resolution", "1e9"), ":2:13:", "beyond reason"),
    ("resolution text", changed("resolution", "fine"), ":2:13:", "must be a number, not 'fine'"),
    ("resolution nothing", changed("resolution", "~"), ":2:13:", "must be a number"),
    ("resolution with unit", changed("resolution", "5 cm"), ":2:13:", "not '5 cm'"),
    ("negate of 2", changed("negate", "2"), ":4:9:", "negate must be 0 or 1, not '2'"),
    ("image empty", changed("image", "''"), ":1:8:", "image is empty"),
    ("image nothing", changed("image", " "), ":1:7:", "image is empty"),
    ("image a list", changed("image", "[a, b]"), ":1:8:", "must be one value"),
    ("no image", changed("image", ""), ":", "has no image"),
    ("no resolution", changed("resolution", ""), ":", "has no resolution; add `resolution: 0.05`"),
    ("no origin", changed("origin", ""), ":", "has no origin"),
    ("no negate", changed("negate", ""), ":", "has no negate; add `negate: 0`"),
    ("no occupied_thresh", changed("occupied_thresh", ""), ":", "add `occupied_thresh: 0.65`"),
    ("no free_thresh", changed("free_thresh", ""), ":", "add `free_thresh: 0.196`"),
    ("duplicate key", GOOD + "resolution: 0.1\n", ":7:1:", "'resolution' is given twice"),
    ("empty", "", ":", "empty"),
    ("only blanks", " \n\n", ":", "empty"),
    ("only a comment", "# map\n", ":", "not a mapping"),
    ("a list", "- image: a\n- b\n", ":1:1:", "not a mapping"),
    ("a word", "hello\n", ":1:1:", "not a mapping"),
    ("tabs", "image: a.pgm\n\tresolution: 0.05\n", ":2:1:", "cannot start any token"),
    ("unclosed", "image: [a\n", ":2:1:", "expected"),
    ("no colon", "image: a.pgm\nresolution 0.05\nnegate: 0\n", ":3:", "expected ':'"),
    ("two documents", GOOD + "---\n" + GOOD, ":7:1:", "document"),
    ("python tag", GOOD + "x: !!python/object/apply:os.system [id]\n", ":7:4:", "is refused"),
    ("own tag", changed("resolution", "!x 0.05"), ":2:13:", "tag !x is refused"),
    ("alias", "image: &a map.pgm\nmode: *a\n", ":2:7:", "alias *a is refused"),
    ("complex key", "? [a, b]\n: c\n", ":1:3:", "a key must be one value"),
    ("control characters", GOOD + "x: \x07\n", ":7:4:", "character that yaml forbids"),
    ("not UTF-8", GOOD.encode() + b"x: \xff\xfe\n", ":7:4:", "not text in UTF-8"),
    ("a picture", b"\x89PNG\r\n\x1a\n" + bytes(100), ":1:1:", "not text in UTF-8"),
    ("huge", GOOD + "# " + "x" * 70_000, ":", "bytes are too many"),
    ("deep", "image: " + "[" * 30_000 + "]" * 30_000, ":1:27:", "nested too deeply"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "place", "words"), [f[1:] for f in FAULTS], ids=[f[0] for f in FAULTS]
)
def test_faults(text: str | bytes, place: str, words: str) -> None:
    start = time.process_time()
    with pytest.raises(FormatError) as caught:
        read(text)
    line = str(caught.value)
    assert line.startswith(f"map.yaml{place}")
    assert words in line
    assert "\n" not in line
    assert caught.value.exit_code == 1
    assert time.process_time() - start < 2


def test_there_are_at_least_the_27_faults() -> None:
    assert len({name for name, *_ in FAULTS}) >= 27


def test_an_alias_bomb_is_refused_at_once() -> None:
    """Nine levels of nine references each would be 387 million words."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    for i in range(1, 9):
        lines.append(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]")
    start = time.process_time()
    with pytest.raises(FormatError, match=r"map\.yaml:2:10: alias \*a0 is refused"):
        read("\n".join(lines))
    assert time.process_time() - start < 1


def test_unknown_keys_are_said_and_ignored() -> None:
    notes = Notes()
    read(GOOD + "resolutoin: 3\nmin_height: 0.0\nauthor: x\n", notes=notes)
    assert [str(n) for n in notes] == [
        "map.yaml: key 'resolutoin' is unknown and ignored; did you mean resolution?",
        "map.yaml: key 'author' is unknown and ignored",
    ]


def test_the_image_may_be_missing_where_the_picture_is_given() -> None:
    assert read(changed("image", ""), picture=True).image == ""


def test_nothing_is_executed(tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    text = GOOD + f"x: !!python/object/apply:os.mkdir ['{mark}']\n"
    with pytest.raises(FormatError, match="refused"):
        read(text)
    assert not mark.exists()


@given(st.binary(max_size=300))
def test_any_bytes_are_an_error_or_a_map(data: bytes) -> None:
    with pytest.raises(FormatError):
        read(data)


@given(st.text(max_size=40), st.sampled_from(KEYS[:-1]))
def test_any_value_is_an_error_or_what_pyyaml_reads(value: str, key: str) -> None:
    text = changed(key, value.strip() or "~")
    try:
        values = read(text)
    except FormatError as error:
        assert "\n" not in str(error)  # noqa: PT017 - both outcomes are allowed
    else:
        loaded = pyyaml.safe_load(text)
        assert values.resolution == float(loaded["resolution"])
        assert list(values.origin) == [float(v) for v in loaded["origin"]]
