"""The docs site builds without a broken link, fetches nothing, and ships layouts for viewers."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from formats.frame import Particles
from replay.cli import VERBS
from tests.runs import START, write_run

ROOT = Path(__file__).resolve().parent.parent
PAGES_OF_VERBS = {"paper": "reproduction", "demo": "command_line", "completion": "command_line"}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", str(folder)]
    env = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "DISABLE_MKDOCS_2_WARNING": "true"}
    done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


def test_it_builds_every_page(site: Path) -> None:
    for page in (ROOT / "docs").glob("*.md"):
        assert "<h1" in (site / page.with_suffix(".html").name).read_text()


def test_no_page_loads_anything_from_elsewhere(site: Path) -> None:
    for page in site.rglob("*.html"):
        for tag in re.findall(r"<(?:script|link|img|iframe)\b[^>]*>", page.read_text()):
            if 'rel="canonical"' not in tag:
                assert not re.search(r'(?:src|href)="(?:https?:)?//', tag), f"{page.name}: {tag}"
    for sheet in site.rglob("*.css"):
        assert not re.search(r"url\([\"']?(?:https?:)?//", sheet.read_text()), sheet.name


def test_every_verb_has_a_page() -> None:
    for verb in VERBS:
        page = ROOT / "docs" / f"{PAGES_OF_VERBS.get(verb, verb)}.md"
        assert f"replay {verb}" in page.read_text(), verb


def test_layouts_name_topics_that_results_have(tmp_path: Path) -> None:
    from rosbags.highlevel import AnyReader

    localised = {
        "particles": [Particles(START, np.zeros((1, 3)))],
        "covariances": (np.array([START]), np.eye(3)[None]),
    }
    with AnyReader([write_run(tmp_path / "a.mcap", 5, **localised)]) as reader:
        topics = {c.topic: reader.typestore.get_msgdef(c.msgtype) for c in reader.connections}
    layout = json.loads((ROOT / "docs/viewers/foxglove.json").read_text())["configById"]
    assert set(layout["3D!replay"]["topics"]) <= set(topics)
    for name, panel in layout.items():
        for path in panel.get("paths", []) if name.startswith("Plot!") else []:
            topic, field = path["value"].rsplit(".", 1)
            names = [entry[0] for entry in topics[topic].fields]
            assert field in names, path["value"]
    rviz = yaml.safe_load((ROOT / "docs/viewers/replay.rviz").read_text())
    displays = rviz["Visualization Manager"]["Displays"]
    shown = {entry["Topic"]["Value"]: entry for entry in displays if "Topic" in entry}
    assert set(shown) <= set(topics)
    assert shown["/particle_cloud"]["Topic"]["Reliability Policy"] == "Best Effort"  # or none come
    for topic in ("/map", "/prior"):
        assert shown[topic]["Topic"]["Durability Policy"] == "Transient Local"
