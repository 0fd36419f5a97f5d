"""Plans and maps: a picture, what of it is wall, and where it lies."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from pathlib import Path

from formats.errors import FormatError, Notes, UsageError
from formats.errors import Path as AnyPath
from formats.frame import Pose
from formats.plans.apart import opener
from formats.plans.grid_in_log import plan_of_log, topic_in
from formats.plans.ink import drawn, paper_grey
from formats.plans.map_file import cells_of
from formats.plans.map_text import is_map_text, open_map_text, text_inside, values_of
from formats.plans.map_yaml import MapYaml, read_map_yaml
from formats.plans.paper import (
    Asked,
    Distance,
    Opened,
    Sheet,
    is_drawing,
    is_dxf,
    is_pdf,
    is_svg,
    measured,
    resolution_of,
)
from formats.plans.plan import Cells, Extent, Mask, Plan, overlap
from formats.plans.raster import Grey, is_picture, read_raster

__all__ = [
    "OPENERS",
    "SUFFIXES",
    "YAML_SUFFIXES",
    "Cells",
    "Extent",
    "Mask",
    "Plan",
    "open_plan",
    "overlap",
]

LARGEST_FILE = 700_000_000
SUFFIXES = (".png", ".pgm", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".ppm", ".pbm")
YAML_SUFFIXES = (".yaml", ".yml")


def open_plan(
    path: AnyPath,
    notes: Notes,
    *,
    yaml: AnyPath | None = None,
    resolution: float | None = None,
    origin: Pose | None = None,
    invert: bool | None = None,
    page: int = 0,
    dpi: float | None = None,
    drawing_scale: float | None = None,
    distance: Distance | None = None,
) -> Plan:
    """Read a plan: a picture or drawing, with the map yaml given or of its stem, or a map yaml.

    A map of Wean Hall's kind (text) says its own scale; `LOG:/map` is the last OccupancyGrid on a
    topic of a log (see grid_in_log).

    With a yaml, nav2's rules say what is wall (`map_file.cells_of`). A plain picture's wall is its
    ink, grey below half of white; light lines on a dark ground are noticed and turned over.

    Args:
        path: a picture, or a map yaml, whose `image` is then followed.
        notes: choices and oddities.
        yaml: holds instead of the one beside the picture.
        resolution: m a pixel; overrules the yaml's.
        origin: pose of the lower left corner; overrules the yaml's.
        invert: True or False: whether the ink is light, instead of looking.
        page: of a PDF, from 0.
        dpi: pixels an inch that PDF and SVG are rendered at, or that a picture was scanned at.
        drawing_scale: 200 of 1:200; None: the one that a PDF's or an SVG's text names.
        distance: x1, y1, x2, y2 in pixels, y down, and the m between; overrules the yaml's
            resolution too.

    Raises:
        FormatError: not readable, too large, damaged, of one colour, or without any wall; faults
            of the yaml with line and column.
    """
    picture = Path(path)
    if (named := topic_in(picture)) is not None:
        plan = plan_of_log(*named, notes, resolution=resolution, origin=origin)
        _check(plan.path, plan.grey, plan.occupancy)
        return plan
    inputs: dict[str, str] = {}
    if _is_yaml(picture):
        if yaml is not None and Path(yaml) != picture:
            raise UsageError(picture, "is a yaml itself, and another one is given", hint="one only")
        values: MapYaml | None = _read_yaml(picture, notes, inputs, picture=False)
        picture = _pictured(picture, values.image, notes) if values else picture
    else:
        text = Path(yaml) if yaml is not None else _yaml_beside(picture)
        if (
            text
            and yaml is None
            and is_drawing(_bytes(picture, 4096))
            and not _names(text, picture)
        ):
            text = None  # it tells of the pixels of another picture
        values = _read_yaml(text, notes, inputs, picture=True) if text else None
        if text and values and Path(values.image).name != picture.name:
            said = f"says {values.image!r}" if values.image else "is missing"
            notes.warn(text, f"its image {said}; its values are taken for {picture.name}")
    data = _bytes(picture)
    inputs[str(picture)] = hashlib.sha256(data).hexdigest()
    data = text_inside(data)
    values = values or values_of(data)
    if distance is not None:
        resolution = measured(picture, distance, resolution)
    wanted = values.resolution if values and resolution is None else resolution
    asked = Asked(invert, page, dpi, None if distance else wanted, drawing_scale)
    (grey, occupancy), sheet = _opener(picture, data)(picture, data, values, asked, notes)
    _check(picture, grey, occupancy)
    if wanted is None:
        resolution = _by_scale(picture, sheet, asked, notes)
    if values:
        resolution = values.resolution if resolution is None else resolution
        origin = values.origin if origin is None else origin
    place = origin or Pose(0.0, 0.0, 0.0)
    return Plan(picture, grey, occupancy, resolution, place, origin is not None, inputs)


def _by_scale(path: Path, sheet: Sheet | None, asked: Asked, notes: Notes) -> float | None:
    """Metres a pixel of a drawing by its own word.

    Raises:
        UsageError: a drawing scale is given, and nothing says how large a pixel is on paper.
    """
    resolution, remark = resolution_of(sheet, asked)
    if remark:
        notes.warn(path, remark)
    if resolution is None and asked.drawing_scale is not None:
        raise UsageError(path, "nothing says how many dots an inch it has", hint="give --plan-dpi")
    return resolution


def _check_file(path: Path) -> None:
    """There must be an ordinary file of a size within reason.

    Raises:
        FormatError: there is none.
    """
    try:
        if path.is_dir():
            raise FormatError(path, "is a folder, not a plan")
        if not path.exists():
            raise FormatError(path, "does not exist")
        if not path.is_file():
            raise FormatError(path, "is not an ordinary file")
        size = path.stat().st_size
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror or error}") from None
    if size > LARGEST_FILE:
        raise FormatError(path, f"{size:,} bytes are too many for a plan")


def _bytes(path: Path, most: int = -1) -> bytes:
    """The file, or its first bytes."""
    _check_file(path)
    try:
        with path.open("rb") as file:
            return file.read(most)
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror or error}") from None


def _is_yaml(path: Path) -> bool:
    """By its suffix, else by its first words."""
    if path.suffix.lower() in YAML_SUFFIXES:
        return True
    head = _bytes(path, 4096)
    return b"\0" not in head and bool(re.search(rb"^(image|resolution):\s", head, re.MULTILINE))


def _names(yaml: Path, picture: Path) -> bool:
    """Whether a map yaml's image is this very picture."""
    found = re.search(rb"^image:[ \t]*(.*)$", _bytes(yaml, 65_536), re.MULTILINE)
    return found is not None and picture.name.encode() in found[1]


def _read_yaml(path: Path, notes: Notes, inputs: dict[str, str], *, picture: bool) -> MapYaml:
    data = _bytes(path)
    inputs[str(path)] = hashlib.sha256(data).hexdigest()
    return read_map_yaml(path, data, notes, picture=picture)


def _yaml_beside(picture: Path) -> Path | None:
    """The map yaml of the picture's stem, where there is one."""
    for suffix in YAML_SUFFIXES:
        if picture.with_suffix(suffix).is_file():
            return picture.with_suffix(suffix)
    return None


def _pictured(yaml: Path, image: str, notes: Notes) -> Path:
    """The picture that a yaml names, or the one of its stem beside it."""
    named = yaml.parent / image
    if _exists(named):
        return named
    stems = [yaml.with_suffix(s) for s in (Path(image).suffix, *SUFFIXES) if s.startswith(".")]
    for other in (*stems, yaml.parent / Path(image).name):
        if other.suffix.lower() not in YAML_SUFFIXES and _exists(other):
            notes.warn(yaml, f"its image {image!r} is not there; {other.name} beside it is taken")
            return other
    hint = f"put the picture beside it as {yaml.with_suffix('.png').name}"
    raise FormatError(yaml, f"its image {image!r} is not there", hint=hint)


def _exists(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name too long, or with a NUL
        return False


Opener = Callable[[Path, bytes, MapYaml | None, Asked, Notes], Opened]


def open_raster(
    path: Path, data: bytes, values: MapYaml | None, asked: Asked, notes: Notes
) -> Opened:
    """Grey and occupancy of a picture of pixels, and its size on paper."""
    raster = read_raster(path, data, notes, colour=values is not None)
    if values is not None:
        if raster.header.turn != 1:
            notes.warn(path, "its EXIF turn is ignored, since a map yaml holds for the stored rows")
        occupancy = cells_of(path, raster, values, notes)
        return (raster.grey(upright=False), occupancy), None
    grey = paper_grey(path, raster, notes)
    sheet = Sheet(grey, raster.header.paper)
    del raster  # several times the size of the grey
    return drawn(path, grey, asked.invert, notes), sheet


OPENERS: tuple[tuple[Callable[[bytes], bool], Opener], ...] = (
    (is_picture, open_raster),
    (is_map_text, open_map_text),
    (is_pdf, opener("pdf")),
    (is_svg, opener("svg")),
    (is_dxf, opener("dxf")),
)
"""What the first 4 KiB tell -> what reads it."""

STRANGERS = (
    (rb"version https://git-lfs", "is a Git LFS pointer, not the picture; run `git lfs pull`"),
    (rb"AC10\d\d", "is a DWG, which is not read; save it as DXF or PDF"),
    (rb"\x89MCAP|#ROSBAG|SQLite format 3", "is a log, not a plan; a map in it is LOG:/TOPIC"),
)


def _opener(path: Path, data: bytes) -> Opener:
    """By the first bytes, whatever the suffix.

    Raises:
        FormatError: nothing fits; says what it is where that is known.
    """
    head = data[:4096]
    if not head:
        raise FormatError(path, "is empty (0 bytes)")
    for fits, opens in OPENERS:
        if fits(head):
            return opens
    for pattern, what in STRANGERS:
        if re.match(pattern, head, re.DOTALL):
            raise FormatError(path, what)
    raise FormatError(
        path, "is not a picture that is read", hint="give PNG, JPEG, TIFF, PDF, SVG or DXF"
    )


def _check(path: Path, grey: Grey, occupancy: Cells) -> None:
    """A plan must show something.

    Raises:
        FormatError: one colour, nothing but wall, or no wall at all.
    """
    rows, cols = grey.shape
    size = f"{cols} x {rows} pixels"
    low, high = int(grey.min()), int(grey.max())
    if low == high:
        name = {0: "black", 255: "white"}.get(low, f"grey {low}")
        raise FormatError(path, f"every pixel is {name} ({size})", hint="is it the right picture?")
    highest = int(occupancy.max())
    if highest <= 50:
        what = "nothing in it is known" if highest < 0 else f"no pixel of it is wall ({size})"
        raise FormatError(path, what, hint="walls must be darker than half of white, or occupied")
    if int(occupancy.min()) > 50:
        raise FormatError(path, f"every pixel of it is wall ({size})")
