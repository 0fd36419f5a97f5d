"""PDF, SVG and DXF: ink where it was drawn, the scale exact, and hostile files in one line."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from formats.errors import FormatError, Notes, UsageError
from formats.picture_header import PictureError
from formats.plans import apart
from formats.plans.file import Plan, open_plan
from formats.plans.paper import Asked, page_dpi, scales_in
from tests import pictures
from tests.drawing_files import binary_dxf, dxf, new_dxf, pdf, svg

INCH = 0.0254


def opened(folder: Path, name: str, data: bytes, notes: Notes | None = None, **given: Any) -> Plan:
    (folder / name).write_bytes(data)
    return open_plan(folder / name, Notes() if notes is None else notes, **given)


def ink_box(plan: Plan) -> tuple[int, int, int, int]:
    """First and last row, first and last column of the ink."""
    rows, cols = np.nonzero(plan.wall)
    return int(rows.min()), int(rows.max()), int(cols.min()), int(cols.max())


def test_a_pdf_is_rendered_where_it_was_drawn(tmp_path: Path) -> None:
    # A bar of 36 x 9 points whose lower left corner is 18 points in, on 144 x 72: at 144 dpi, two
    # pixels a point, columns 36 to 107 and rows 144 - 2 (18 + 9) = 90 to 107.
    plan = opened(tmp_path, "a.pdf", pdf("0 g 18 18 36 9 re f"), dpi=144, drawing_scale=200)
    assert plan.grey.shape == (144, 288)
    assert ink_box(plan) == (90, 107, 36, 107)
    assert plan.wall.sum() == 72 * 18
    assert plan.resolution == pytest.approx(INCH / 144 * 200, rel=1e-12)


def test_a_pdf_says_its_scale_in_words(tmp_path: Path) -> None:
    words = "BT /F1 8 Tf 10 50 Td (Scale 1:50 at 12:30) Tj ET 0 g 18 18 36 9 re f"
    assert opened(tmp_path, "a.pdf", pdf(words)).resolution == pytest.approx(INCH / 200 * 50)
    given = opened(tmp_path, "a.pdf", pdf(words), drawing_scale=100)
    assert given.resolution == pytest.approx(INCH / 200 * 100)
    # A resolution with a known scale chooses how finely the page is rendered.
    fine = opened(tmp_path, "a.pdf", pdf(words), resolution=INCH / 100 * 50)
    assert fine.grey.shape == (100, 200)
    notes = Notes()
    two = words.replace("12:30", "1:20")
    assert opened(tmp_path, "a.pdf", pdf(two), notes).resolution is None
    assert "1:50, 1:20" in str(notes.of("warning")[0])


@pytest.mark.parametrize(
    ("text", "scales"),
    [
        ("M 1:100", (100,)),
        ("Escala 1/200", (200,)),
        ("at 11:50, 21:100, 1:50:30, 1:333, 1/2", ()),
        ("1:20 1 : 50 1:20", (20, 50)),
    ],
)
def test_scales_are_told_from_times_and_shares(text: str, scales: tuple[int, ...]) -> None:
    assert scales_in(text) == scales


def test_pages_of_a_pdf(tmp_path: Path) -> None:
    data = pdf("0 g 18 18 36 9 re f", pages=3)
    notes = Notes()
    opened(tmp_path, "a.pdf", data, notes, page=2)
    assert "3 pages; page 3 is read" in str(notes.of("warning")[0])
    with pytest.raises(FormatError, match="no page 4; --plan-page 1 to 3"):
        opened(tmp_path, "a.pdf", data, page=3)


def test_an_svg_is_rendered_where_it_was_drawn(tmp_path: Path) -> None:
    # 50 mm at 254 dpi are 500 pixels, 5 a view box unit.
    body = '<g transform="translate(10 5)"><rect x="10" y="5" width="20" height="4"/></g>'
    path = '<path d="M60 10 H70 V14 H60 Z"/><text x="5" y="45">Scale 1:100</text>'
    plan = opened(tmp_path, "a.svg", svg(body + path), dpi=254)
    assert plan.grey.shape == (250, 500)
    wall = np.zeros((250, 500), dtype=bool)
    wall[50:70, 100:200] = wall[50:70, 300:350] = True
    np.testing.assert_array_equal(plan.wall, wall)
    assert plan.resolution == pytest.approx(0.0001 * 100)


def test_svg_strokes_curves_and_entities(tmp_path: Path) -> None:
    circle = '<circle cx="50" cy="25" r="20" fill="none" stroke="&ink;" stroke-width="2"/>'
    head = b'<?xml version="1.0"?><!DOCTYPE svg [<!ENTITY ink "#000">]>'
    plan = opened(tmp_path, "a.svg", head + svg(circle), dpi=254)
    ring = math.pi * (21**2 - 19**2) * 25
    assert plan.wall.sum() == pytest.approx(ring, rel=0.01)
    assert ink_box(plan) == (20, 229, 145, 354)


@pytest.mark.parametrize(
    ("head", "inches"),
    [
        ('width="2in" height="1in"', (2, 1)),
        ('width="192" height="96px"', (2, 1)),
        ('viewBox="0 0 192 96" width="100%"', (2, 1)),
        ('viewBox="0 0 4 2" width="5.08cm"', (2, 1)),
        ('viewBox="0,0,4,2" height="72pt"', (2, 1)),
    ],
)
def test_sizes_of_an_svg(tmp_path: Path, head: str, inches: tuple[int, int]) -> None:
    shape = svg('<rect width="1" height="1"/>', head)
    plan = opened(tmp_path, "a.svg", shape, dpi=96, drawing_scale=10)
    assert plan.grey.shape == (96 * inches[1], 96 * inches[0])
    assert plan.resolution == pytest.approx(INCH / 96 * 10)


def test_linked_pictures_are_not_opened(tmp_path: Path) -> None:
    black = np.zeros((4, 4), dtype=np.uint8)
    (tmp_path / "black.png").write_bytes(pictures.png(black))
    link = f'<image href="{tmp_path / "black.png"}" width="50" height="50"/>'
    notes = Notes()
    plan = opened(tmp_path, "a.svg", svg(link + '<rect x="90" width="2" height="2"/>'), notes)
    assert not plan.wall[:, :300].any()
    assert "1 linked pictures are left out" in str(notes.of("warning")[0])


def room() -> Any:
    """A DXF in mm: outer lines 4 x 3 m, a block put in twice, a filled hatch, an arc, a text."""
    document = new_dxf()
    model = document.modelspace()
    model.add_lwpolyline([(0, 0), (4000, 0), (4000, 3000), (0, 3000)], close=True)
    block = document.blocks.new("POST")
    block.add_lwpolyline([(0, 0), (100, 0), (100, 100), (0, 100)], close=True)
    model.add_blockref("POST", (1000, 1000))
    model.add_blockref("POST", (2000, 1000), dxfattribs={"rotation": 90})
    hatch = model.add_hatch(color=7)
    hatch.paths.add_polyline_path([(3000, 1000), (3500, 1000), (3500, 1200), (3000, 1200)])
    model.add_arc((2000, 2000), 500, 0, 90)
    model.add_text("1:50", dxfattribs={"insert": (500, 2500), "height": 200})
    return document


def test_a_dxf_is_rendered_where_it_was_drawn(tmp_path: Path) -> None:
    plan = opened(tmp_path, "a.dxf", dxf(room()), resolution=0.02)
    assert plan.resolution == 0.02
    assert plan.grey.shape == (150 + 20, 200 + 20)  # 10 pixels of paper around

    def at(x: float, y: float) -> tuple[slice, slice]:
        """Pixels within one of a place in mm."""
        row, col = 10 + 150 - y / 20, 10 + x / 20
        return slice(int(row) - 2, int(row) + 2), slice(int(col) - 2, int(col) + 2)

    drawn = [(0, 1500), (2000, 0), (4000, 1500), (2000, 3000), (1050, 1000), (1100, 1050)]
    drawn += [(1900, 1050), (2000, 1050), (3250, 1100), (2500, 2000), (2000, 2500), (2354, 2354)]
    assert [p for p in drawn if not plan.wall[at(*p)].any()] == []
    empty = [(1500, 1050), (1500, 2000), (600, 2600), (700, 2550), (3250, 1500)]
    assert [p for p in empty if plan.wall[at(*p)].any()] == []
    assert plan.wall[at(3250, 1100)].all()


def test_a_binary_dxf_is_the_same_drawing(tmp_path: Path) -> None:
    text = opened(tmp_path, "text.dxf", dxf(room()), resolution=0.02)
    binary = opened(tmp_path, "binary.dxf", binary_dxf(room()), resolution=0.02)
    assert (binary.resolution, binary.grey.tobytes()) == (text.resolution, text.grey.tobytes())


@pytest.mark.parametrize(("unit", "metres"), [(1, INCH), (2, 0.3048), (4, 0.001), (6, 1.0)])
def test_units_of_a_dxf(tmp_path: Path, unit: int, metres: float) -> None:
    document = new_dxf(unit)
    document.modelspace().add_lwpolyline([(0, 0), (8 / metres, 0), (8 / metres, 4 / metres)])
    plan = opened(tmp_path, "a.dxf", dxf(document))
    assert plan.resolution == pytest.approx(0.01)
    first, last, left, right = ink_box(plan)
    assert abs(right - left - 800) <= 1
    assert abs(last - first - 400) <= 1


def test_a_dxf_without_a_unit_leaves_the_scale_open(tmp_path: Path) -> None:
    notes = Notes()
    plan = opened(tmp_path, "a.dxf", dxf(new_dxf_line(0)), notes)
    assert plan.resolution is None
    assert "no unit" in str(notes.of("warning")[0])


def new_dxf_line(unit: int = 4, far: float = 4000.0) -> Any:
    document = new_dxf(unit)
    document.modelspace().add_line((0, 0), (far, 3000))
    return document


def bomb() -> bytes:
    """Ten blocks, each of ten of the one before: 10^10 lines."""
    document = new_dxf()
    document.blocks.new("B0").add_line((0, 0), (100, 0))
    for level in range(1, 11):
        block = document.blocks.new(f"B{level}")
        for k in range(10):
            block.add_blockref(f"B{level - 1}", (k, level))
    document.modelspace().add_blockref("B10", (0, 0))
    return dxf(document)


def circular() -> bytes:
    document = new_dxf()
    document.blocks.new("A").add_blockref("B", (1, 1))
    document.blocks.new("B").add_blockref("A", (1, 1))
    document.modelspace().add_blockref("A", (0, 0))
    return dxf(document)


def test_what_a_dxf_holds_and_is_not_drawn_is_said(tmp_path: Path) -> None:
    notes = Notes()
    opened(tmp_path, "a.dxf", dxf(room()).replace(b"LWPOLYLINE", b"LWXXXXXINE"), notes)
    assert "LWXXXXXINE is left out" in "".join(str(note) for note in notes.of("warning"))


LAUGHS = (
    b"<!DOCTYPE svg [<!ENTITY a0 'ha'>"
    + b"".join(b"<!ENTITY a%d '%s'>" % (i, b"&a%d;" % (i - 1) * 10) for i in range(1, 12))
    + b"]>"
    + svg("<text>&a11;</text>")
)
HOSTILE = {
    "pdf cut": (pdf("0 g 1 1 9 9 re f")[:60], "damaged or cut"),
    "pdf without pages": (pdf(pages=0), "damaged or cut"),
    "pdf of nothing": (pdf(), "every pixel is white"),
    "pdf locked": (
        pdf(
            extra="/Encrypt << /Filter /Standard /V 1 /R 2 /P -4 "
            f"/O <{'12' * 32}> /U <{'34' * 32}> >> /ID [<{'00' * 16}> <{'00' * 16}>] "
        ),
        "asks for a password",
    ),
    "svg of 1e9": (svg("<rect width='9' height='9'/>", 'width="1e9" height="1e9"'), "reason"),
    "svg of nan": (svg("<rect width='9' height='9'/>", 'width="nan" height="9"'), "says no size"),
    "svg without a size": (svg("<rect width='9' height='9'/>", ""), "says no size"),
    "svg cut": (svg("<rect width='9' height='9'/>")[:-9], "no sound XML"),
    "svg of laughs": (LAUGHS, "no sound XML"),
    "svg far away": (svg("<rect x='1e30' width='1e9' height='9'/>"), "white"),
    "svg nested deep": (svg("<g>" * 30_000 + "</g>" * 30_000), "nested too deep"),
    "dxf cut": (dxf(room())[:-400], "the DXF is cut"),
    "binary dxf cut": (binary_dxf(room())[:-400], "the DXF is cut"),
    "binary dxf with a hole": (binary_dxf(room()).replace(b"HEADER", b"\xff\xff"), "is damaged"),
    "dxf empty": (dxf(new_dxf()), "draws nothing"),
    "dxf of 1e9 m": (dxf(new_dxf_line(6, 1e9)), "more than a building"),
    "dxf of 1e300": (dxf(new_dxf_line(6, 1e300)), "beyond reason"),
    "dxf of blocks in blocks": (bomb(), "unfold"),
    "dxf of blocks that hold themselves": (circular(), "holds itself"),
    "dwg": (b"AC1032" + bytes(99), "is a DWG"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_end_in_one_line(tmp_path: Path, name: str) -> None:
    data, words = HOSTILE[name]
    with pytest.raises(FormatError, match=words) as caught:
        opened(tmp_path, name.replace(" ", "_"), data)
    assert "\n" not in str(caught.value)


def test_what_takes_too_long_is_ended(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="not rendered within"):
        apart.rendered("dxf", tmp_path / "a.dxf", bomb(), Asked(), seconds=0.05)


def test_a_page_that_does_not_fit_is_rendered_coarser() -> None:
    dpi, remarks = page_dpi(Asked(), 200, 100)  # 200 dpi would be 800 megapixels
    assert 0.99 * math.sqrt(1e4) < dpi < math.sqrt(1e4)
    assert "to fit" in remarks[0]
    for asked in (Asked(dpi=200), Asked(resolution=INCH, drawing_scale=200)):
        with pytest.raises(PictureError, match="over the limit"):
            page_dpi(asked, 200, 100)


def test_two_points_and_their_distance_scale_a_picture(tmp_path: Path) -> None:
    pixels = np.full((40, 60), 255, dtype=np.uint8)
    pixels[10:12, 5:55] = 0
    data = pictures.png(pixels)
    plan = opened(tmp_path, "a.png", data, distance=(5.0, 10.0, 35.0, 50.0, 2.5))
    assert plan.resolution == 0.05
    with pytest.raises(UsageError, match="give one of them"):
        opened(tmp_path, "a.png", data, distance=(5, 10, 35, 50, 2.5), resolution=0.05)


def test_dots_an_inch_of_pictures_scale_them(tmp_path: Path) -> None:
    import cv2

    pixels = np.full((40, 60), 255, dtype=np.uint8)
    pixels[10:12, 5:55] = 0
    phys = pictures.chunk(b"pHYs", (10_000).to_bytes(4, "big") * 2 + b"\1")
    data = pictures.png(pixels, extra=phys)
    assert opened(tmp_path, "a.png", data).resolution is None
    assert opened(tmp_path, "a.png", data, drawing_scale=100).resolution == pytest.approx(0.01)
    _, jpeg = cv2.imencode(".jpg", pixels)
    at = jpeg.tobytes().index(b"JFIF\0") + 7
    data = jpeg.tobytes()[:at] + b"\1\0\x64\0\x64" + jpeg.tobytes()[at + 5 :]  # 100 dpi
    assert opened(tmp_path, "a.jpg", data, drawing_scale=100).resolution == pytest.approx(INCH)
    flags = [cv2.IMWRITE_TIFF_RESUNIT, 2, cv2.IMWRITE_TIFF_XDPI, 200, cv2.IMWRITE_TIFF_YDPI, 200]
    _, tiff = cv2.imencode(".tif", pixels, flags)
    plan = opened(tmp_path, "a.tif", tiff.tobytes(), drawing_scale=100)
    assert plan.resolution == pytest.approx(INCH / 2)
    bare = pictures.png(pixels)
    assert opened(tmp_path, "a.png", bare, drawing_scale=100, dpi=100).resolution == INCH
    with pytest.raises(UsageError, match="--plan-dpi"):
        opened(tmp_path, "a.png", bare, drawing_scale=100)


def test_a_yaml_of_another_picture_does_not_scale_a_drawing(tmp_path: Path) -> None:
    text = "image: {}\nresolution: 0.05\norigin: [0, 0, 0]\n"
    values = "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    (tmp_path / "a.yaml").write_text(text.format("a.png") + values)
    assert opened(tmp_path, "a.pdf", pdf("0 g 18 18 36 9 re f")).resolution is None
    (tmp_path / "a.yaml").write_text(text.format("a.pdf") + values)
    assert opened(tmp_path, "a.pdf", pdf("0 g 18 18 36 9 re f")).resolution == 0.05


def test_a_real_pdf_is_its_picture_of_200_dpi(shared_data: Path) -> None:
    """TD_n1.png is TD_n1.pdf, 1:200 by its own words, at 200 dpi: 0.0254 m a pixel."""
    folder = shared_data / "plans_with_logs/uji_tech_building/plan"
    if not (folder / "TD_n1.pdf").is_file():
        pytest.skip(f"no TD_n1.pdf in {folder}")
    drawing = open_plan(folder / "TD_n1.pdf", Notes())
    picture = open_plan(folder / "TD_n1.png", Notes())
    assert drawing.grey.shape == picture.grey.shape
    # The page is not of whole pixels; it is stretched by less than one of 6623.
    assert drawing.resolution == pytest.approx(0.0254, rel=1 / 6623)
    near = np.zeros_like(drawing.wall)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            near |= np.roll(drawing.wall, (down, right), (0, 1))
    assert (picture.wall & near).sum() > 0.999 * picture.wall.sum()
