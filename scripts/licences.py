"""Writes docs/licences.md: what is installed with the project, and under which licence.

    python -m scripts.licences

Of every package in scripts/locks/run.txt as it is installed here. A package whose metadata say
nothing has its licence in READ, from the licence file that it brings.
"""

from __future__ import annotations

import re
from importlib.metadata import PackageMetadata, metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "licences.md"
READ = {
    "apsw": "any OSI-approved (own text, as of zlib)",
    "graphemeu": "MIT",
    "resvg-py": "MIT",
}
HEAD = """# Licences
plan-replay is under Apache-2.0. What is installed with it (`scripts/locks/run.txt`), by
`python -m scripts.licences`:

| package | licence |
|---|---|
"""
TAIL = """
All may be used by a project under Apache-2.0. One is copyleft: `moocore` (LGPL-2.1-or-later), which
pymoo needs; it is imported, as a package of its own that anybody may replace, and no part of it is
in ours. The binary wheels of numpy, scipy, OpenCV (with FFmpeg, LGPL-2.1), pyarrow and pypdfium2
bring libraries with licences of their own, which lie in those wheels. Nothing of them is in the
wheel of plan-replay, which is pure Python and holds no data but its own sample logs.
"""


def locked() -> list[str]:
    """Names in the lock."""
    lines = (ROOT / "scripts" / "locks" / "run.txt").read_text().splitlines()
    return sorted({re.split(r"[=; ]", line)[0] for line in lines if line[:1].isalnum()})


def licence(name: str, found: PackageMetadata) -> str:
    """The expression, or the classifiers, or the field where it is a name and not a whole text."""
    said = found.get_all("License-Expression")
    if said:
        return str(said[0])
    if name in READ:
        return READ[name]
    classes = [
        str(line).split(" :: ")[-1]
        for line in found.get_all("Classifier") or []
        if str(line).startswith("License ::")
    ]
    field = [str(text) for text in found.get_all("License") or [] if len(str(text)) < 60]
    told = ", ".join(
        field[:1] if len(classes) > 1 and "dual" not in str(field).lower() else classes
    )
    told = told or ", ".join(field)
    if not told:
        raise SystemExit(f"{name} does not say its licence: read it, and add it to READ")
    return told


def row(name: str) -> str:
    """A package's line."""
    return f"| {name} | {licence(name, metadata(name))} |"


def main() -> None:
    PAGE.write_text(HEAD + "\n".join(row(name) for name in locked()) + "\n" + TAIL)


if __name__ == "__main__":
    main()
