"""Maps, poses and scores of a result in the formats of others: map_server, TUM, CSV, PNG."""

from __future__ import annotations

import csv
import io
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from formats.errors import FormatError, Notes, UsageError
from formats.errors import Path as AnyPath
from formats.frame import Pose
from formats.grid import Evidence
from formats.output import check_output, is_folder, write_image, write_text
from formats.plans.map_file import write_map
from formats.result import Counts
from formats.results.file import RunFile, read_result
from formats.results.records import ratios
from formats.trajectory import write_tum

FrameName = Literal["plan", "map"]
HERE = Pose(0.0, 0.0, 0.0)
PICTURE = 1000  # px, the longer side of a picture of a small map, at least
UNSEEN, FADED = 205.0, 0.4  # cells that no reading saw fade towards this grey
RATIOS = ("precision", "recall", "f2")
PATH, START = (178, 114, 0), (0, 94, 213)  # blue, green, red; told apart with any colour vision


def export(
    result: AnyPath,
    out: AnyPath | None = None,
    what: Iterable[str] | None = None,
    *,
    fill_prior: bool = False,
    frame: FrameName = "plan",
    force: bool = False,
    notes: Notes | None = None,
) -> list[Path]:
    """Write parts of a result in formats that others read, all of them or none.

    Args:
        result: a result file.
        out: a folder that is there, or the stem of the files' names. None: the result's name, in
            the current folder.
        what: names from WHAT. None: all that the result holds.
        fill_prior: cells that no reading saw show the prior instead of unknown; probabilities
            are kept then (`mode: scale`).
        frame: maps and poses in the plan's frame, or in the frame of the poses.
        force: replace existing files.
        notes: takes what was odd.

    Returns:
        The files that were written.

    Raises:
        UsageError: a part that is unknown, or that this result does not hold.
        FormatError: the result cannot be read; a file cannot be written.
    """
    run = read_result(result, notes)
    chosen = list(WHAT) if what is None else list(dict.fromkeys(what))
    for name in chosen:
        if name not in WHAT:
            raise UsageError(
                result, f"cannot export {name!r}", hint=f"choose from {', '.join(WHAT)}"
            )
    place = HERE if frame == "plan" else run.map_to_plan
    stem = stem_of(Path(result), out)
    with _folder_beside(stem) as folder:
        job = Job(run, Path(folder) / stem.name, place, fill_prior, run.evidence())
        for name in chosen:
            try:
                held = WHAT[name](job)
            except FormatError as error:  # about the temporary folder: said of the real one
                raise FormatError(stem.parent, error.problem, hint=error.hint) from error
            if not held and what is not None:
                raise UsageError(result, f"the result holds no {name}")
        files = sorted(Path(folder).iterdir())
        targets = [stem.parent / file.name for file in files]
        for target in targets:
            check_output(target, force=force, inputs=[result])
        for file, target in zip(files, targets, strict=True):
            file.replace(target)
    return targets


def stem_of(result: Path, out: AnyPath | None) -> Path:
    """Folder and first part of the names of all files."""
    name = result.name.removesuffix(".mcap").removesuffix(".replay") or "result"
    if out is None:
        return Path(name)
    return Path(out) / name if is_folder(out) else Path(out)


def _folder_beside(stem: Path) -> tempfile.TemporaryDirectory[str]:
    """A temporary folder on the file system of the outputs."""
    check_output(stem.with_name(stem.name + ".yaml"), force=True)  # says what ails the folder
    return tempfile.TemporaryDirectory(dir=stem.parent, prefix=f".{stem.name[:40]}.")


@dataclass(slots=True)
class Job:
    """What one export writes from.

    Attributes:
        run: the result.
        stem: folder and first part of the files' names.
        place: pose of the plan's frame in the frame that is written.
        fill_prior: unseen cells show the prior.
        evidence: of the whole run.
    """

    run: RunFile
    stem: Path
    place: Pose
    fill_prior: bool
    evidence: Evidence

    def path(self, end: str) -> Path:
        """The file of this ending."""
        return self.stem.with_name(f"{self.stem.name}_{end}")


def _map(job: Job) -> bool:
    """The main curve's map."""
    mode: Literal["scale", "trinary"] = "scale" if job.fill_prior else "trinary"
    grid, seen = job.run.curves[job.run.main].of(job.evidence), job.evidence.visits() > 0
    write_map(job.path("map"), grid, seen, mode=mode, fill_prior=job.fill_prior, frame=job.place)
    return True


def _map_without_prior(job: Job) -> bool:
    """The map of the readings alone, in which nothing fills what they did not see."""
    if "none" not in job.run.curves:
        return False
    grid = job.run.curves["none"].of(job.evidence)
    write_map(job.path("map_without_prior"), grid, job.evidence.visits() > 0, frame=job.place)
    return True


def _prior(job: Job) -> bool:
    """The prior, with its probabilities."""
    prior = next((c.prior for c in job.run.curves.values() if c.prior.values.any()), None)
    if prior is None:
        return False
    write_map(job.path("prior"), prior, mode="scale", frame=job.place)
    return True


def _poses(job: Job) -> bool:
    """The sensor's poses."""
    poses = [job.place @ Pose(*pose) for pose in job.run.poses.tolist()]
    write_tum(job.path("poses.tum"), job.run.times_ns.tolist(), poses)
    return True


def _metrics(job: Job) -> bool:
    """The scores after every frame, a row each."""
    if not job.run.counts:
        return False
    times = job.run.times_ns.tolist()
    columns: dict[str, Iterable[Any]] = {"frame": range(len(times)), "time_ns": times}
    for curve, counts in job.run.counts.items():
        parts = {"": counts.sum(axis=1), "observed_": counts[:, 0], "unobserved_": counts[:, 1]}
        for part, cells in parts.items():
            for names, values in ((RATIOS, ratios(cells)), (Counts._fields, cells)):
                columns |= {
                    f"{curve}_{part}{n}": values[:, i].tolist() for i, n in enumerate(names)
                }
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([unarmed(name) for name in columns])
    table.writerows(zip(*columns.values(), strict=True))
    write_text(job.path("metrics.csv"), text.getvalue())
    return True


def unarmed(text: str) -> str:
    """Text for a CSV cell that no spreadsheet takes for a formula."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r", "\n")) else text


def _picture(job: Job) -> bool:
    """The main map with the path in it: unseen cells pale, start and end marked."""
    import cv2

    run, g = job.run, job.run.geometry
    white = 255.0 * (1.0 - run.curves[run.main].of(job.evidence).p_occupied())
    grey = np.where(job.evidence.visits() > 0, white, UNSEEN + (white - UNSEEN) * FADED)
    times = max(1, -(-PICTURE // max(g.shape)))
    shade = np.rint(grey[::-1]).astype(np.uint8).repeat(times, axis=0).repeat(times, axis=1)
    image = cv2.cvtColor(shade, cv2.COLOR_GRAY2BGR)
    cells = (run.poses[:, :2] - (g.x, g.y)) / g.resolution
    pixels = np.column_stack([cells[:, 0], g.rows - cells[:, 1]]) * times - 0.5
    line = np.rint(pixels * 16).astype(np.int32)  # cv2 counts in sixteenths of a pixel
    thick = max(2, times // 2)
    cv2.polylines(image, [line], False, PATH, thick, cv2.LINE_AA, 4)
    for end, colour in ((line[0], START), (line[-1], PATH)):
        cv2.circle(image, end.tolist(), 16 * (3 + thick), colour, -1, cv2.LINE_AA, 4)
    write_image(job.path("picture.png"), np.asarray(image, dtype=np.uint8))
    return True


WHAT: dict[str, Callable[[Job], bool]] = {
    "map": _map,
    "map_without_prior": _map_without_prior,
    "prior": _prior,
    "poses": _poses,
    "metrics": _metrics,
    "picture": _picture,
}
