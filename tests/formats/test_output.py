"""Outputs appear whole or not at all."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

import pytest

from formats.errors import FormatError
from formats.output import atomic, check_output, write_bytes, write_image, write_text


def test_writes_the_file_and_leaves_nothing_else(tmp_path: Path) -> None:
    write_text(tmp_path / "a.txt", "one\r\ntwo\n")
    assert (tmp_path / "a.txt").read_bytes() == b"one\r\ntwo\n"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]


def test_the_mode_is_that_of_an_ordinary_new_file(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    write_bytes(tmp_path / "ours", b"x")
    modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("plain", "ours")]
    assert modes[0] == modes[1]


def test_existing_output_is_kept_without_force(tmp_path: Path) -> None:
    old = tmp_path / "a.txt"
    old.write_text("old")
    with pytest.raises(FormatError, match=r"a\.txt: exists already; .*--force"):
        write_text(old, "new")
    assert old.read_text() == "old"
    write_text(old, "new", force=True)
    assert old.read_text() == "new"


def test_a_dangling_link_exists_too(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    with pytest.raises(FormatError, match="exists already"):
        check_output(tmp_path / "link")


@pytest.mark.parametrize("force", [False, True])
def test_an_input_is_never_replaced(tmp_path: Path, force: bool) -> None:
    source = tmp_path / "log.mcap"
    source.write_text("log")
    (tmp_path / "other_name.mcap").hardlink_to(source)
    for name in ("log.mcap", "./log.mcap", "other_name.mcap"):
        with pytest.raises(FormatError, match="the output is also an input"):
            write_text(tmp_path / name, "x", force=force, inputs=[source])
    assert source.read_text() == "log"


def test_an_input_folder_gets_no_file(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    with pytest.raises(FormatError, match="lies inside the input"):
        check_output(bag / "out.mcap", inputs=[bag])
    check_output(tmp_path / "out.mcap", inputs=[bag])


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("missing/a.txt", "the folder .*missing does not exist"),
        ("file/a.txt", "file is not a folder"),
        ("folder", "is a folder"),
        ("pipe", "not an ordinary file"),
        ("x" * 300, "the name is too long"),
    ],
)
def test_impossible_places_are_one_line(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(FormatError, match=message) as caught:
        write_text(tmp_path / name, "x", force=True)
    assert "\n" not in str(caught.value)
    assert sorted(tmp_path.iterdir()) == before


def test_a_folder_that_refuses_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root may write anywhere
    with pytest.raises(FormatError, match=r"cannot be written to; give another folder"):
        check_output(tmp_path / "a.txt")


@pytest.mark.parametrize("failure", [KeyboardInterrupt(), ValueError("x")])
def test_a_failing_block_leaves_the_old_output(tmp_path: Path, failure: BaseException) -> None:
    old = tmp_path / "a.txt"
    old.write_text("old")

    def write() -> None:
        with atomic(old, force=True) as part:
            part.write_text("half")
            raise failure

    with pytest.raises(type(failure)):
        write()
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("a.txt", "old")]


def test_a_full_disk_is_one_line(tmp_path: Path) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("this system has no /dev/full")

    def write(target: Path) -> None:
        with atomic(target) as part:
            part.unlink()
            part.symlink_to(full)
            part.write_bytes(b"x" * 100_000)

    target = tmp_path / "full.bin"
    with pytest.raises(FormatError, match="no space left on the disk") as caught:
        write(target)
    assert "\n" not in str(caught.value)
    assert not target.exists()


def test_an_error_about_another_file_is_not_blamed_on_the_output(tmp_path: Path) -> None:
    def write() -> None:
        with atomic(tmp_path / "a.txt"):
            (tmp_path / "input").read_bytes()

    with pytest.raises(FileNotFoundError, match="input"):
        write()


def test_nothing_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="nothing could be written"), atomic(tmp_path / "a"):
        pass
    assert not list(tmp_path.iterdir())


def test_another_may_not_slip_in_between(tmp_path: Path) -> None:
    target = tmp_path / "a"

    def write() -> None:
        with atomic(target) as part:
            part.write_text("ours")
            target.write_text("theirs")

    with pytest.raises(FormatError, match="exists already"):
        write()
    assert target.read_text() == "theirs"


def test_quota_is_named(tmp_path: Path) -> None:
    def write() -> None:
        with atomic(tmp_path / "a"):
            raise OSError(errno.EDQUOT, "Disk quota exceeded")

    with pytest.raises(FormatError, match="quota"):
        write()


def test_pictures_read_back(tmp_path: Path) -> None:
    import cv2
    import numpy as np

    pixels = np.arange(12, dtype=np.uint8).reshape(3, 4)
    write_image(tmp_path / "a.pgm", pixels)
    assert (tmp_path / "a.pgm").read_bytes().endswith(bytes(range(12)))
    write_image(tmp_path / "a.png", pixels)
    back = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)
    assert back is not None
    assert np.array_equal(back, pixels)
