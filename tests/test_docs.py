"""Every console block of the docs is run, and shows what the commands really print.

`BLESS=1 pytest tests/test_docs.py` writes what was printed into the docs; a person reads the diff.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PAGES = sorted(
    page
    for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    if BLOCK.search(page.read_text())
)
CLOCK = re.compile(r" in \d+\.\d s(?=,|$)", re.MULTILINE)  # how long it took is not the same twice


def same_every_time(text: str) -> str:
    """Printed text without what depends on the clock."""
    return CLOCK.sub(" in 1.0 s", text)


def run(command: str, folder: Path) -> str:
    """What a command prints, and its exit code where that is not 0."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=folder,
        env={**os.environ, "PATH": path, "COLUMNS": "100", "NO_COLOR": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    code = f"exit {done.returncode}\n" if done.returncode else ""
    return same_every_time(done.stdout) + code


def played(block: str, folder: Path) -> str:
    """The block as it ought to read: each `$ command` followed by what it prints now."""
    commands = [line[2:] for line in block.splitlines() if line.startswith("$ ")]
    assert commands, f"a console block without a command:\n{block}"
    return "".join(f"$ {command}\n{run(command, folder)}" for command in commands)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_console_blocks_show_what_is_printed(page: Path, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "sample_logs", tmp_path / "sample_logs")
    text = page.read_text()
    now = BLOCK.sub(lambda found: f"```console\n{played(found[1], tmp_path)}```", text)
    if os.environ.get("BLESS") and now != text:
        page.write_text(now)
    assert now == text


def test_links_lead_somewhere() -> None:
    for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text()):
            if "://" not in target:
                assert (page.parent / target).exists(), f"{page.name}: {target}"
