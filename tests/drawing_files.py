"""Drawings of lines made by hand: PDF from bytes, DXF by ezdxf."""

from __future__ import annotations

import io
from typing import Any

from ezdxf.filemanagement import new


def pdf(
    content: str = "", *, page: tuple[float, float] = (144, 72), pages: int = 1, extra: str = ""
) -> bytes:
    """A PDF of equal pages, sides in points (72 an inch), with `content` of drawing operators."""
    kids = " ".join(f"{5 + i} 0 R" for i in range(pages))
    box = f"[0 0 {page[0]:.10g} {page[1]:.10g}]"
    objects = [
        "<< /Type /Catalog /Pages 2 0 R >>",
        f"<< /Type /Pages /Kids [{kids}] /Count {pages} >>",
        f"<< /Length {len(content)} >>\nstream\n{content}\nendstream",
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
        *[
            f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents 3 0 R "
            "/Resources << /Font << /F1 4 0 R >> >> >>"
        ]
        * pages,
    ]
    out, starts = b"%PDF-1.4\n", []
    for number, body in enumerate(objects, 1):
        starts.append(len(out))
        out += f"{number} 0 obj\n{body}\nendobj\n".encode()
    table = "".join(f"{start:010d} 00000 n \n" for start in starts)
    trailer = f"trailer\n<< /Size {len(objects) + 1} /Root 1 0 R {extra}>>"
    text = f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n{table}{trailer}\n"
    return out + f"{text}startxref\n{len(out)}\n%%EOF\n".encode()


def svg(body: str = "", head: str = 'width="50mm" height="25mm" viewBox="0 0 100 50"') -> bytes:
    """An SVG; two view box units a mm unless told otherwise."""
    return f'<svg xmlns="http://www.w3.org/2000/svg" {head}>{body}</svg>'.encode()


def new_dxf(unit: int = 4) -> Any:
    """An empty drawing by ezdxf; unit 4: mm."""
    document = new("R2010")
    document.header["$INSUNITS"] = unit
    return document


def dxf(document: Any) -> bytes:
    text = io.StringIO()
    document.write(text)
    return text.getvalue().encode()


def binary_dxf(document: Any) -> bytes:
    """The same drawing as AutoCAD's binary DXF."""
    stream = io.BytesIO()
    document.write(stream, fmt="bin")
    return stream.getvalue()
