"""demo(): the sample drive and its plan, to try everything with."""

from __future__ import annotations

from pathlib import Path

from formats.errors import FormatError
from formats.errors import Path as AnyPath
from formats.output import check_output, write_bytes

HERE = Path(__file__).resolve().parent
FOLDERS = (HERE / "sample_logs", HERE.parent / "sample_logs")  # of a wheel, of a checkout
FILES = (
    *("turtlebot.mcap", "plan.png", "plan.yaml", "truth.png", "truth.yaml"),
    *("drawing.png", "drawing.yaml"),
)
COMMANDS = (
    "replay info turtlebot.mcap",
    "replay run turtlebot.mcap --prior plan.png --truth truth.png",
    "replay view turtlebot.replay.mcap",
    "replay report turtlebot.replay.mcap",
    "replay deviation turtlebot.replay.mcap",
    "replay export turtlebot.replay.mcap",
    "replay plan drawing.png",
)


def demo(folder: AnyPath = "replay-demo", *, force: bool = False) -> list[Path]:
    """Write the sample files into a folder, which is made.

    Args:
        folder: where.
        force: replace files that exist.

    Returns:
        the files that were written.

    Raises:
        FormatError: the folder cannot be made, or a file exists.
    """
    found = next((path for path in FOLDERS if path.is_dir()), None)
    if found is None:
        raise FormatError(FOLDERS[0], "the sample files were not installed")
    target = Path(folder)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        problem = f"the folder cannot be made: {error.strerror or error}"
        raise FormatError(target, problem) from error
    written = [target / name for name in FILES]
    for path in written:
        check_output(path, force=force)
    for path in written:
        write_bytes(path, (found / path.name).read_bytes(), force=force)
    return written
