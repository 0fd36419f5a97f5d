"""Files of ours appear whole or not at all: temporary name, fsync, rename in the same folder."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from formats.errors import FormatError
from formats.errors import Path as AnyPath

ELSEWHERE = "give another folder"
RENAME = "give another name"
REASONS = {
    errno.ENOSPC: ("no space left on the disk", f"free some, or {ELSEWHERE}"),
    errno.EDQUOT: ("the disk quota is used up", f"free some, or {ELSEWHERE}"),
    errno.EACCES: ("cannot be written: permission denied", ELSEWHERE),
    errno.EPERM: ("cannot be written: not permitted", ELSEWHERE),
    errno.EROFS: ("cannot be written: a read-only file system", ELSEWHERE),
    errno.ENAMETOOLONG: ("the name is too long", "give a shorter one"),
}


def cannot_write(path: AnyPath, error: OSError) -> FormatError:
    """The one line for the operating system's refusal to write `path`."""
    other = (f"cannot be written: {error.strerror or error}", "")
    problem, hint = REASONS.get(error.errno or 0, other)
    return FormatError(path, problem, hint=hint)


def check_output(path: AnyPath, *, force: bool = False, inputs: Iterable[AnyPath] = ()) -> None:
    """Refuse an output before any work is done for it.

    Args:
        path: the file to be written.
        force: an existing file may be replaced (never one of the inputs).
        inputs: files and folders that are read; none may be, or hold, the output.

    Raises:
        FormatError: the folder is missing or not writable; the output is an input or not an
            ordinary file; it exists and `force` is not given.
    """
    target = Path(path)
    try:
        _check_folder(target)
        real = Path(os.path.realpath(target))  # unlike resolve(), at ease with links in a circle
        for source in map(Path, inputs):
            if real == Path(os.path.realpath(source)) or _same_file(target, source):
                raise FormatError(path, "the output is also an input", hint=RENAME)
            if is_folder(source) and real.is_relative_to(os.path.realpath(source)):
                raise FormatError(path, f"the output lies inside the input {source}", hint=RENAME)
        if target.is_dir():
            raise FormatError(path, "is a folder", hint="give the name of a file")
        if target.exists() and not target.is_file():
            raise FormatError(path, "is not an ordinary file", hint=RENAME)
        if not force:
            _must_be_new(target)
    except OSError as error:
        raise cannot_write(path, error) from error


def is_folder(path: AnyPath) -> bool:
    """Whether it is a folder; a name that is too long for one is none."""
    with contextlib.suppress(OSError):
        return Path(path).is_dir()
    return False


def is_there(path: AnyPath) -> bool:
    """Whether anything is there, be it a link to nothing; a name that is too long has nothing."""
    with contextlib.suppress(OSError):
        Path(path).lstat()
        return True
    return False


def check_room(path: AnyPath, least: int) -> None:
    """Refuse an output whose disk has fewer than `least` bytes free.

    Raises:
        FormatError: it has not.
    """
    if shutil.disk_usage(Path(path).parent).free < least:
        problem, hint = REASONS[errno.ENOSPC]
        raise FormatError(path, problem, hint=hint)


def _check_folder(target: Path) -> None:
    """The folder of `target` must be there and take new files."""
    folder = target.parent
    if not folder.exists():
        raise FormatError(target, f"the folder {folder} does not exist", hint="make it first")
    if not folder.is_dir():
        raise FormatError(target, f"{folder} is not a folder", hint=RENAME)
    if not os.access(folder, os.W_OK | os.X_OK):
        raise FormatError(target, f"the folder {folder} cannot be written to", hint=ELSEWHERE)


def _same_file(a: Path, b: Path) -> bool:
    """Hard links and other names of one file count as one."""
    with contextlib.suppress(OSError):  # one of them is not there, or cannot be
        return a.samefile(b)
    return False


def _must_be_new(target: Path) -> None:
    if target.exists() or target.is_symlink():
        raise FormatError(target, "exists already", hint=f"{RENAME}, or --force to replace it")


@contextlib.contextmanager
def atomic(path: AnyPath, *, force: bool = False, inputs: Iterable[AnyPath] = ()) -> Iterator[Path]:
    """A temporary file beside the output that becomes the output when the block ends well.

    The block writes the file it is given, by any means, and closes it. At the end the file is
    synced and renamed; after an exception (Ctrl-C too) it is removed and an older output stays
    as it was. It has the output's suffix, since cv2.imwrite goes by that.

    Args:
        path: the output.
        force: replace an existing output.
        inputs: files and folders that are read, none of which may be or hold the output.

    Yields:
        The path of an empty temporary file, `.STEM.XXXXXXXX.part.SUFFIX`.

    Raises:
        FormatError: see `check_output`; the disk is full or refuses; nothing was written.
    """
    target = Path(path)
    check_output(target, force=force, inputs=inputs)
    name = f".{target.stem[:40]}.{secrets.token_hex(4)}.part{target.suffix}"
    part = target.parent / name
    try:
        os.close(os.open(part, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield part
        if part.stat().st_size == 0:  # cv2.imwrite on a full disk returns False and raises nothing
            raise FormatError(path, "nothing could be written", hint="is the disk full?")
        _sync(part)
        if not force:  # another may have written it meanwhile
            _must_be_new(target)
        part.replace(target)
        with contextlib.suppress(OSError):  # some file systems cannot sync a folder
            _sync(target.parent)
    except OSError as error:
        if error.filename not in (None, str(part)):  # about another file that the block touched
            raise
        raise cannot_write(path, error) from error
    finally:
        part.unlink(missing_ok=True)


@contextlib.contextmanager
def atomic_folder(
    path: AnyPath, *, mark: str, force: bool = False, inputs: Iterable[AnyPath] = ()
) -> Iterator[Path]:
    """The same for a folder: the block makes the one that it is given, which is not there yet.

    It has the output's own name, since some formats name their files by it.

    Args:
        path: the output.
        mark: a file that folders of this kind hold; with `force` only such a folder (or an empty
            one) is replaced, so that a slip of the pen costs no other folder.
        force, inputs: as of `atomic`.

    Raises:
        FormatError: see `check_output`; the folder that is there is of another kind.
    """
    target = Path(path)
    old = target.is_dir() and not target.is_symlink()
    if old and not force:
        _must_be_new(target)
    if old and not (target / mark).is_file() and any(target.iterdir()):
        raise FormatError(path, f"is a folder without {mark}: not replaced", hint=RENAME)
    beside = target.parent / f".{target.name[:40]}.{secrets.token_hex(4)}.part"
    check_output(beside if old else target, force=force, inputs=inputs)
    for source in inputs:
        if old and Path(os.path.realpath(source)).is_relative_to(os.path.realpath(target)):
            raise FormatError(path, f"the input {source} lies inside the output", hint=RENAME)
    try:
        beside.mkdir()
        made = beside / target.name
        yield made
        for file in sorted(made.iterdir()):
            _sync(file)
        if old:
            target.rename(beside / "replaced")
        elif not force:
            _must_be_new(target)
        made.rename(target)
        with contextlib.suppress(OSError):
            _sync(target.parent)
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _sync(path: Path) -> None:
    """Have the disk hold what was written."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def write_bytes(
    path: AnyPath, data: bytes, *, force: bool = False, inputs: Iterable[AnyPath] = ()
) -> None:
    """Write bytes whole or not at all; see `atomic`."""
    with atomic(path, force=force, inputs=inputs) as part:
        part.write_bytes(data)


def write_text(
    path: AnyPath, text: str, *, force: bool = False, inputs: Iterable[AnyPath] = ()
) -> None:
    """Write text as UTF-8 with the line ends it has, whole or not at all; see `atomic`."""
    write_bytes(path, text.encode(), force=force, inputs=inputs)


def write_image(
    path: AnyPath,
    pixels: npt.NDArray[np.uint8] | npt.NDArray[np.uint16],
    *,
    force: bool = False,
    inputs: Iterable[AnyPath] = (),
) -> None:
    """Write a picture (H, W) or (H, W, 3 BGR / 4 BGRA), format by suffix; see `atomic`."""
    import cv2

    with atomic(path, force=force, inputs=inputs) as part:
        ok, data = cv2.imencode(part.suffix, pixels)
        if not ok:
            raise FormatError(path, "the picture could not be encoded")
        part.write_bytes(data.tobytes())
