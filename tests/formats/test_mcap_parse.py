from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from formats.mcap.parse import MalformedError, parse, records
from formats.mcap.records import CHANNEL, MESSAGE_INDEX, STATISTICS
from tests.mcap_files import CODES, McapBytes


def conformance_files(folder: Path) -> list[Path]:
    return sorted((folder / "mcap_conformance").rglob("*.mcap"))


def as_json(value: object) -> object:
    """A field as the conformance suite writes it: numbers as strings, bytes as lists of them."""
    if isinstance(value, dict):
        return {str(key): as_json(item) for key, item in value.items()}
    if isinstance(value, bytes | memoryview):
        return [str(byte) for byte in value]
    return str(value)


def described(record: Any) -> dict[str, Any]:
    kind = type(record).__name__
    fields = record._asdict()
    if kind == "Attachment":
        del fields["crc"]  # the suite leaves it out
    return {
        "type": kind.removeprefix("Raw"),
        "fields": [[name, as_json(fields[name])] for name in sorted(fields)],
    }


def test_all_conformance_files_read_equal_to_their_records(shared_data: Path) -> None:
    files = conformance_files(shared_data)
    assert len(files) == 416
    for path in files:
        expected = json.loads(path.with_suffix(".json").read_text())["records"]
        assert [described(record) for record in records(path.read_bytes())] == expected, path.name


@pytest.mark.parametrize("opcode", range(1, 16))
def test_content_that_is_too_short_is_malformed(opcode: int) -> None:
    with pytest.raises(MalformedError):
        parse(opcode, b"\1")


def test_lengths_inside_a_record_stay_inside() -> None:
    huge = b"\xff\xff\xff\x7f"
    for content in (b"\1\0\1\0" + huge + b"/scan", b"\1\0\1\0\0\0\0\0\0\0\0\0" + huge):
        with pytest.raises(MalformedError):
            parse(CHANNEL, content)
    with pytest.raises(MalformedError, match="pairs"):
        parse(MESSAGE_INDEX, b"\1\0\4\0\0\0abcd")
    with pytest.raises(MalformedError):
        parse(STATISTICS, bytes(42) + b"\3\0\0\0abc")


def test_bad_utf8_names_stay_different() -> None:
    one, two = (
        parse(CHANNEL, b"\1\0\0\0\2\0\0\0/" + byte + bytes(8)) for byte in (b"\xff", b"\xfe")
    )
    assert one.topic == "/\\xff"  # type: ignore[union-attr]
    assert two.topic == "/\\xfe"  # type: ignore[union-attr]


def test_conformance_files_without_padding_are_written_byte_for_byte(shared_data: Path) -> None:
    plain = [path for path in conformance_files(shared_data) if "-pad" not in path.name]
    assert len(plain) == 208
    for path in plain:
        document = json.loads(path.with_suffix(".json").read_text())
        features = set(document["meta"]["variant"]["features"])
        names = {kind.__name__.removeprefix("Raw"): kind for kind in CODES}
        file = McapBytes(profile="", compression="", chunk_messages=99, features=features)
        for item in document["records"]:
            if item["type"] == "DataEnd":
                break
            if item["type"] != "Header":
                file.add(from_json(names[item["type"]], dict(item["fields"])))
        assert file.finish() == path.read_bytes(), path.name


def from_json(kind: Any, fields: dict[str, Any]) -> Any:
    values = []
    for name, letter in zip(kind._fields, CODES[kind][1], strict=True):
        value = fields.get(name, "1")  # an attachment's CRC, which the suite leaves out
        if letter in "HIQ":
            value = int(value)
        elif letter in "bLr":
            value = bytes(map(int, value))
        values.append(value)
    return kind(*values)
