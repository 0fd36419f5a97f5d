"""Drawings as PDF: one page in grey by PDFium, and the scale that its text names."""

from __future__ import annotations

from formats.picture_header import INCH, PictureError
from formats.plans.paper import Asked, Sheet, page_dpi, scales_in

POINTS = 72  # an inch


def render(data: bytes, asked: Asked) -> Sheet:
    """One page of a PDF.

    Raises:
        PictureError: locked, damaged, without that page, or too large.
    """
    import pypdfium2

    try:
        document = pypdfium2.PdfDocument(data)
    except pypdfium2.PdfiumError:
        if pypdfium2.raw.FPDF_GetLastError() == pypdfium2.raw.FPDF_ERR_PASSWORD:
            raise PictureError("the PDF asks for a password", "save it without one") from None
        raise PictureError("the PDF is damaged or cut", "copy it again, or save as PNG") from None
    pages = len(document)
    if pages == 0:
        raise PictureError("the PDF has no page")
    if not 0 <= asked.page < pages:
        raise PictureError(f"the PDF has no page {asked.page + 1}", f"--plan-page 1 to {pages}")
    try:
        page = document[asked.page]
        width, height = (side / POINTS for side in page.get_size())
        scales = scales_in(page.get_textpage().get_text_bounded())
        dpi, remarks = page_dpi(asked, width, height, scales)
        grey = page.render(scale=dpi / POINTS, grayscale=True).to_numpy()
    except pypdfium2.PdfiumError as error:
        raise PictureError(f"its page {asked.page + 1} is damaged ({error})") from None
    grey = grey.reshape(grey.shape[:2])
    if pages > 1:
        remarks = (*remarks, f"has {pages} pages; page {asked.page + 1} is read (--plan-page)")
    # PDFium stretches the page by less than a pixel to fill whole ones.
    return Sheet(grey, width * INCH / grey.shape[1], scales, remarks=remarks)
