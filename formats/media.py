"""Media types of the files that a result keeps."""

from __future__ import annotations

from pathlib import PurePath

MEDIA = {
    ".jpg": "image/jpeg",
    ".json": "application/json",
    ".pdf": "application/pdf",
    ".pgm": "image/x-portable-graymap",
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".tiff": "image/tiff",
    ".toml": "application/toml",
    ".yaml": "application/yaml",
}


def media_type(name: str) -> str:
    """Of a file, by its name's suffix."""
    return MEDIA.get(PurePath(name).suffix.lower(), "application/octet-stream")
