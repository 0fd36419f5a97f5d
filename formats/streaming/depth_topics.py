"""Which topics of pictures hold depth, by the first picture of each."""

from __future__ import annotations

from formats.decoding import decoder_of
from formats.depth.scans import ENCODINGS
from formats.errors import printable
from formats.log import Log, Topic
from formats.messages import CompressedImage
from formats.payload import Undecodable
from formats.sensing.scans import SENSORS


def depth_topics(log: Log, topics: list[Topic]) -> tuple[list[Topic], str]:
    """The topics without those of colour or infrared pictures, and what these are ("" none).

    mono16 may be either: it is taken for depth where nothing else is.
    """
    waiting = {(t.name, t.type) for t in topics if SENSORS[t.type].forward == 2}
    encodings: dict[tuple[str, str], str] = {}
    pictures = [t for t in topics if (t.name, t.type) in waiting]
    for topic, _, data in log.messages(pictures) if waiting else ():
        key = topic.name, topic.type
        if key in waiting:
            encodings[key] = encoding_of(topic, data)
            waiting.remove(key)
        if not waiting:
            break
    depth = [t for t in topics if encodings.get((t.name, t.type), "16UC1") in ENCODINGS]
    sure = [t for t in depth if encodings.get((t.name, t.type)) != "mono16"]
    others = [encodings[t.name, t.type] for t in topics if t not in depth]
    return sure or depth, f"{printable(others[0], 40)} is no depth" if others else ""


def encoding_of(topic: Topic, data: bytes | memoryview) -> str:
    """What the pixels of a picture are; "16UC1" where it is damaged, which counts later on."""
    read = decoder_of(topic)
    assert read is not None
    try:
        picture = read(data)
    except Undecodable:
        return "16UC1"
    if not isinstance(picture, CompressedImage):
        return str(picture.encoding)
    from formats.depth.png import MAGIC

    packed = picture.data[:64].tobytes()
    at = packed.find(MAGIC)
    deep = at >= 0 and packed[at + 24 : at + 26] == b"\x10\x00"  # IHDR: 16 bits, grey
    return "16UC1" if deep or "compressedDepth" in picture.format else picture.format or "unnamed"
