"""Values of a prior read back as they were written, and what is none is refused in a line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from formats.errors import FormatError
from formats.plans.prior_values import PriorValues, read_prior_values, write_prior_values


def test_they_read_back_to_the_same_bits(tmp_path: Path) -> None:
    written = PriorValues(
        1 / 3, 0.1 + 0.2, 0.55, 0.3, 0.5, 0.9, 0.7, 0.4, "paper", {"pick": "best F2"}
    )
    write_prior_values(tmp_path / "v.json", written)
    read = read_prior_values(tmp_path / "v.json")
    assert read == written
    assert read.source == {"pick": "best F2"}


def test_what_is_not_said_is_no_option(tmp_path: Path) -> None:
    write_prior_values(tmp_path / "v.json", PriorValues(0.2, 0.9, update="bayes"))
    read = read_prior_values(tmp_path / "v.json")
    assert read.options() == {"p_wall": 0.2, "p_space": 0.9, "update": "bayes"}


GOOD = {"format": "replay prior values", "version": 1, "p_wall": 0.2, "p_space": 0.9}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": "replay placement"}, "no values"),
        ({"version": 2}, "version 2"),
        ({"p_walls": 0.2}, "no value 'p_walls'"),
        ({"p_wall": 1.5}, "p_wall is 1.5"),
        ({"p_space": "0.9"}, "p_space is '0.9'"),
        ({"p_space": True}, "p_space is True"),
        ({"p_door": float("nan")}, "p_door is nan"),
        ({"p_wall": None}, "p_wall is None"),
        ({"prior_scale": 0}, "prior_scale is 0"),
        ({"update": "mean"}, "update is 'mean'"),
    ],
)
def test_what_is_no_such_file_is_refused(tmp_path: Path, change: dict[str, Any], said: str) -> None:
    path = tmp_path / "v.json"
    path.write_text(json.dumps({**GOOD, **change}))
    with pytest.raises(FormatError, match=said) as caught:
        read_prior_values(path)
    assert "\n" not in str(caught.value)


def test_both_main_values_are_needed(tmp_path: Path) -> None:
    path = tmp_path / "v.json"
    path.write_text(json.dumps({name: v for name, v in GOOD.items() if name != "p_space"}))
    with pytest.raises(FormatError, match="p_space is missing"):
        read_prior_values(path)


@pytest.mark.parametrize("text", ["", "{", "[1]", "\x00", "[" * 100_000, "7"])
def test_other_files_are_refused_in_a_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "v.json").write_text(text)
    with pytest.raises(FormatError, match=r"not JSON|no values"):
        read_prior_values(tmp_path / "v.json")
