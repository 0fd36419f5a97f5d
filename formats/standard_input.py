"""`-` as the name of a log: standard input, kept in a temporary file while it is read."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import IO, cast

from formats.errors import FormatError, UsageError

STDIN = Path("-")
LARGEST = 1 << 36  # 64 GiB: a pipe may never end
PIECE = 1 << 20


def copied(largest: int = LARGEST) -> IO[bytes]:
    """All of standard input in a temporary file, gone on close; it stands at its start.

    Args:
        largest: the most bytes to keep.

    Raises:
        UsageError: it is a terminal, or closed.
        FormatError: it is larger, or the temporary folder is too small.
    """
    if sys.stdin is None or sys.stdin.closed or sys.stdin.isatty():
        hint = "pipe a log into it, as in `replay info - < drive.mcap`"
        raise UsageError(STDIN, "nothing comes from standard input", hint=hint)
    temporary = cast("IO[bytes]", tempfile.NamedTemporaryFile(prefix="replay-"))  # noqa: SIM115
    size = 0
    try:
        while piece := sys.stdin.buffer.read(PIECE):
            size += len(piece)
            if size > largest:
                raise FormatError(STDIN, f"is larger than {largest} bytes", hint="give a file")
            temporary.write(piece)
        temporary.flush()
        temporary.seek(0)
    except OSError as error:
        temporary.close()
        hint = f"free space in {tempfile.gettempdir()} or set TMPDIR"
        raise FormatError(STDIN, f"cannot be kept: {error.strerror}", hint=hint) from error
    except BaseException:
        temporary.close()
        raise
    return temporary
