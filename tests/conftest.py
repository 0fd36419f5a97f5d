"""Fixtures that every test may use."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("untimed", deadline=None)  # a loaded machine is no failure
settings.load_profile("untimed")

ROOT = Path(__file__).resolve().parent.parent


def shared_folder() -> Path:
    """The folder of real logs and drawings, which is not part of the project."""
    return Path(os.environ.get("REPLAY_SHARED_DATA", ROOT.parent / "shared" / "data"))


@pytest.fixture
def shared_data() -> Path:
    """Real data, or a skip that says where it was looked for."""
    folder = shared_folder()
    if not folder.is_dir():
        pytest.skip(f"real data are not at {folder} (set REPLAY_SHARED_DATA)")
    return folder


def pytest_configure() -> None:
    """Hear Ctrl-C: a shell's background job ignores it, and processes under test inherit that."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--all` runs the slow tests too."""
    parser.addoption("--all", action="store_true", help="run the slow tests too")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave the slow tests out unless --all is given, and say so in the count."""
    if config.getoption("--all"):
        return
    slow = [item for item in items if item.get_closest_marker("slow")]
    config.hook.pytest_deselected(items=slow)
    items[:] = [item for item in items if item not in slow]
