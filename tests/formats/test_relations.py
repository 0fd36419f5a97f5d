from __future__ import annotations

from pathlib import Path

import pytest

from formats.errors import FormatError
from formats.relations import read_relations

LINE = "976052905.167303 976052911.885496 -0.056990 -0.128430 0.5 0.1 0.2 -1.682210\n"


def test_a_relation_is_two_times_and_a_pose_in_the_plane(tmp_path: Path) -> None:
    path = tmp_path / "a.relations"
    path.write_text("# by hand\n" + LINE + "\n2 1.5 1 2 0 0 0 0.25\n", encoding="utf-8")
    found = read_relations(path)
    assert found.first_ns.tolist() == [976_052_905_167_303_000, 2_000_000_000]
    assert found.second_ns.tolist() == [976_052_911_885_496_000, 1_500_000_000]
    assert found.poses.tolist() == [[-0.05699, -0.12843, -1.68221], [1.0, 2.0, 0.25]]


@pytest.mark.parametrize(
    "text", ["1 2 3\n", LINE.replace("-0.1", "x"), "1 2 nan 0 0 0 0 0\n", "1 1e99 0 0 0 0 0 0\n"]
)
def test_what_is_no_relation_is_named_with_its_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.relations"
    path.write_text(LINE + text, encoding="utf-8")
    with pytest.raises(FormatError, match=r"not a relation.* at line 2"):
        read_relations(path)


def test_no_relations_and_no_file(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("# nothing\n", encoding="utf-8")
    with pytest.raises(FormatError, match="no relations"):
        read_relations(tmp_path / "a")
    with pytest.raises(FormatError, match="cannot be read"):
        read_relations(tmp_path / "b")


def test_those_of_the_benchmark_are_read(shared_data: Path) -> None:
    for name, count in (("intel", 2984), ("aces", 1279)):
        found = read_relations(shared_data / f"carmen/mola_radish/{name}.relations")
        assert len(found.poses) == count
