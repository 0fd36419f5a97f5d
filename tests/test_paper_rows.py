"""docs/paper.md names every row of the paper, and nothing that is not there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from replay.cli import VERBS
from replay.reproduction.reproducing import ROWS

ROOT = Path(__file__).resolve().parent.parent
TEXT = (ROOT / "docs" / "paper.md").read_text()
WANTED = {
    *(f"E{k}" for k in range(1, 24)),
    *(f"D{k}" for k in range(1, 17)),
    *(f"A{k}" for k in range(1, 34) if k not in (26, 29)),
    *ROWS,
}
# `path` or `path` (`name`, `name`, words)
NAMED = re.compile(r"`((?:formats|replay|tests|scripts|docs)/[\w/.]*)`(?: \(([^)]*)\))?")


def rows() -> set[str]:
    """The ids of the tables' first columns; E16-E21 stands for six."""
    found: set[str] = set()
    for cell in re.findall(r"^\| ([A-Z]\d[^|]*?) \|", TEXT, re.MULTILINE):
        for part in cell.split(", "):
            letter, ends = part[0], [int(end) for end in re.findall(r"\d+", part)]
            found |= {f"{letter}{k}" for k in range(ends[0], ends[-1] + 1)}
    return found


def test_every_row_of_the_paper_is_there() -> None:
    assert rows() == WANTED


def test_every_file_that_is_named_exists() -> None:
    named = NAMED.findall(TEXT)
    assert len(named) > 100
    for path, _ in named:
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize(("path", "names"), sorted(set(NAMED.findall(TEXT))))
def test_every_name_in_a_module_exists(path: str, names: str) -> None:
    if path.startswith("tests/") or not path.endswith(".py"):
        return
    source = (ROOT / path).read_text()
    for name in re.findall(r"`([^`]+)`", names):
        last = name.rsplit(".", 1)[-1]
        defined = rf"(?:def|class) {re.escape(last)}\b|^{re.escape(last)}\b|\"{re.escape(last)}\""
        assert re.search(defined, source, re.MULTILINE), f"{path}: {name}"


def test_every_command_is_one() -> None:
    commands = re.findall(r"`replay (\w+)((?: --[\w-]+| \w+)*)`", TEXT)
    assert commands
    for verb, words in commands:
        assert verb in VERBS
        row = re.search(r"--only (\w+)", words)
        assert row is None or row[1] in {*ROWS, "ROW"}
