"""What is exported is what the result holds, as other programs read it."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from formats.errors import FormatError, UsageError
from formats.frame import Frame, Pose
from formats.grid import Evidence, probability
from formats.result import Counts, Split, Step
from formats.results.file import ResultWriter
from formats.trajectory import read_tum
from replay.exporting import WHAT, export, unarmed
from tests.runs import GEOMETRY, SCAN, curves, forge, prior, steps, write_run

NAMES = [
    "a_map.pgm",
    "a_map.yaml",
    "a_map_without_prior.pgm",
    "a_map_without_prior.yaml",
    "a_metrics.csv",
    "a_picture.png",
    "a_poses.tum",
    "a_prior.png",
    "a_prior.yaml",
]


def result(folder: Path, **options: Any) -> Path:
    (folder / "in").mkdir()
    return write_run(folder / "in" / "a.replay.mcap", 40, **options)


def seen_and_maps() -> tuple[Any, dict[str, Any]]:
    """Cells that were seen and the maps of the run, from its steps."""
    *_, last = steps(40)
    assert last.evidence is not None
    return last.evidence.visits() > 0, {k: c.of(last.evidence) for k, c in curves().items()}


def test_everything_into_a_folder(tmp_path: Path) -> None:
    source = result(tmp_path)
    out = tmp_path / "out"
    out.mkdir()
    files = export(source, out)
    assert files == [out / name for name in NAMES]
    assert sorted(out.iterdir()) == files


def test_the_current_folder_is_the_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = result(tmp_path)
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert export(source, what=["poses"]) == [Path("a_poses.tum")]
    assert [path.name for path in Path().iterdir()] == ["a_poses.tum"]


@pytest.mark.parametrize(("part", "curve"), [("map", "bayes"), ("map_without_prior", "none")])
def test_trinary_maps(tmp_path: Path, part: str, curve: str) -> None:
    image, text = export(result(tmp_path), tmp_path / "m", [part])
    pixels = cv2.imread(str(image), cv2.IMREAD_UNCHANGED)
    seen, maps = seen_and_maps()
    expected = np.where(seen, np.where(maps[curve].values < 0, 0, 254), 205)
    assert pixels is not None
    assert np.array_equal(pixels[::-1], expected)
    values = yaml.safe_load(text.read_text())
    assert values["image"] == image.name
    assert (values["mode"], values["resolution"]) == ("trinary", 0.05)
    assert values["origin"] == [-0.2, 0.35, 0.0]
    assert (image.name, text.name) == (f"m_{part}.pgm", f"m_{part}.yaml")


def test_the_prior_and_a_filled_map_keep_their_probabilities(tmp_path: Path) -> None:
    source = result(tmp_path)
    _, maps = seen_and_maps()
    for part, grid in (("prior", prior()), ("map", maps["bayes"])):
        image, text = export(source, tmp_path / "m", [part], fill_prior=True)
        assert yaml.safe_load(text.read_text())["mode"] == "scale"
        pixels = cv2.imread(str(image), cv2.IMREAD_UNCHANGED)
        assert pixels is not None
        assert np.all(pixels[..., 3] == 255)
        p_empty = probability(grid.values)
        assert np.all(np.abs(pixels[::-1, :, 0] - 255 * p_empty) <= 0.5 + 1e-9)


def test_poses_in_the_plans_frame_and_in_that_of_the_poses(tmp_path: Path) -> None:
    source = result(tmp_path)  # the plan lies at 1, 2, 0.5 rad
    expected = [step.frame for step in steps(40)]
    (path,) = export(source, tmp_path / "p", ["poses"])
    read = read_tum(path)
    assert read.times_ns.tolist() == [frame.time_ns for frame in expected]
    assert np.allclose(read.planar(), [frame.pose for frame in expected], rtol=0, atol=1e-12)
    (path,) = export(source, tmp_path / "q", ["poses"], frame="map")
    x, y, _ = expected[0].pose
    turned = 1 + 2j + np.exp(0.5j) * complex(x, y)
    assert np.allclose(read_tum(path).planar()[0, :2], [turned.real, turned.imag], atol=1e-12)
    _, text = export(source, tmp_path / "q", ["map"], frame="map")
    corner = 1 + 2j + np.exp(0.5j) * complex(-0.2, 0.35)
    origin = yaml.safe_load(text.read_text())["origin"]
    assert np.allclose(origin, [corner.real, corner.imag, 0.5], atol=1e-12)


def test_metrics_as_a_table(tmp_path: Path) -> None:
    (path,) = export(result(tmp_path), tmp_path / "m", ["metrics"])
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    expected = list(steps(40))
    assert [int(row["frame"]) for row in rows] == list(range(40))
    assert [int(row["time_ns"]) for row in rows] == [step.frame.time_ns for step in expected]
    for row, step in zip(rows, expected, strict=True):
        for curve, split in step.counts.items():
            for part, c in (
                ("", split.whole),
                ("observed_", split.observed),
                ("unobserved_", split.unobserved),
            ):
                read = {k: row[f"{curve}_{part}{k}"] for k in (*Counts._fields, "f2", "recall")}
                assert Counts(*(int(read[k]) for k in Counts._fields)) == c
                recall = c.tp / (c.tp + c.fn) if c.tp + c.fn else 0.0
                precision = c.tp / (c.tp + c.fp) if c.tp + c.fp else 0.0
                both = 4 * precision + recall
                f2 = 5 * precision * recall / both if both else 0.0
                assert float(read["recall"]) == recall
                assert float(read["f2"]) == pytest.approx(f2, abs=1e-12)


def test_text_that_a_spreadsheet_would_run_is_disarmed(tmp_path: Path) -> None:
    assert unarmed("=cmd|' /C calc'!A0") == "'=cmd|' /C calc'!A0"
    assert [unarmed(t)[0] for t in ("+1", "-1", "@x", "\tx", "\rx")] == ["'"] * 5
    assert unarmed("bayes_f2") == "bayes_f2"
    hostile = tmp_path / "forged.mcap"
    edits = {
        "curves": ('"bayes":', '"=1+1":'),
        "main": ("bayes", "=1+1"),
        "scored": ("bayes", "=1+1"),
    }
    forge(write_run(tmp_path / "good.mcap", 3), hostile, edits, {"/metrics/bayes": "/metrics/=1+1"})
    (path,) = export(hostile, tmp_path / "m", ["metrics"])
    header = next(csv.reader(path.read_text().splitlines()))
    assert any("1+1" in name for name in header)
    assert not [name for name in header if name.startswith(("=", "+", "-", "@"))]


def test_the_picture_shows_the_path_where_it_was(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    counts = Split(Counts(1, 1, 1, 1), Counts(0, 0, 0, 0))
    evidence = Evidence.empty(GEOMETRY, 2)
    corner = Pose(GEOMETRY.x + 0.125, GEOMETRY.y + 0.125, 0.0)  # middle of row 2, column 2
    with ResultWriter(path, geometry=GEOMETRY, curves=curves()) as writer:
        writer.write(Step(0, Frame(0, corner, SCAN), {}, {"bayes": counts}, True, evidence))
        writer.finish()
    (image,) = export(path, tmp_path / "p", ["picture"])
    pixels = cv2.imread(str(image))
    assert pixels is not None
    times = pixels.shape[0] // GEOMETRY.rows
    assert pixels.shape == (GEOMETRY.rows * times, GEOMETRY.cols * times, 3)
    assert pixels.shape[1] >= 1000
    row, col = (GEOMETRY.rows - 2.5) * times, 2.5 * times
    blue, _, red = pixels[int(row), int(col)].tolist()
    assert blue > red  # the dot at the end of the path
    coloured = np.ptp(pixels, axis=2) > 20
    rows, cols = np.nonzero(coloured)
    assert abs(rows.mean() - row) < 1.5
    assert abs(cols.mean() - col) < 1.5


def test_all_or_nothing(tmp_path: Path) -> None:
    source = result(tmp_path)
    out = tmp_path / "out"
    out.mkdir()
    (out / "a_prior.yaml").write_text("old")
    with pytest.raises(FormatError, match=r"a_prior\.yaml: exists already"):
        export(source, out)
    assert [path.name for path in out.iterdir()] == ["a_prior.yaml"]
    assert (out / "a_prior.yaml").read_text() == "old"
    assert len(export(source, out, force=True)) == len(NAMES)
    assert "scale" in (out / "a_prior.yaml").read_text()


def test_what_cannot_be_exported(tmp_path: Path) -> None:
    source = result(tmp_path)
    with pytest.raises(UsageError, match=r"cannot export 'maps'; choose from map, map_without_"):
        export(source, tmp_path / "m", ["maps"])
    with pytest.raises(FormatError, match="does not exist"):
        export(source, tmp_path / "nowhere" / "m")
    bare = write_run(tmp_path / "b.mcap", 3, curves={"bayes": curves()["none"]}, layers={})
    for part in ("prior", "map_without_prior"):
        with pytest.raises(UsageError, match=f"holds no {part}"):
            export(bare, tmp_path / "m", [part])
    assert {path.name for path in tmp_path.iterdir()} == {"in", "b.mcap"}
    names = [path.name for path in export(bare, tmp_path / "m")]
    assert names == ["m_map.pgm", "m_map.yaml", "m_metrics.csv", "m_picture.png", "m_poses.tum"]


def test_the_table_of_parts_is_walked(tmp_path: Path) -> None:
    source = result(tmp_path)
    for name in WHAT:
        assert all(f"_{name}." in path.name for path in export(source, tmp_path / "m", [name]))
