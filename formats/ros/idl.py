"""Fields of the structures in OMG IDL as ROS 2 records it ("ros2idl"), in one pass over its words.

Only what the ROS generators write is understood: modules, structures, typedefs, sequences, arrays.
Anything else gives field types that no decoder knows, which costs that topic alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from formats.ros.standard import Fields

WORD = re.compile(
    r'"(?:[^"\\]|\\.)*"?|//[^\n]*|/\*.*?(?:\*/|\Z)|^[ \t]*(?:#|=====|IDL:)[^\n]*|[\w:.]+|[^\s\w]',
    re.DOTALL | re.MULTILINE,
)
NOISE = ("//", "/*", "#", "=====", "IDL:")
NAMES = {
    **{"boolean": "bool", "octet": "uint8", "char": "char", "float": "float32"},
    **{"double": "float64", "short": "int16", "long": "int32", "long long": "int64"},
    **{"unsigned short": "uint16", "unsigned long": "uint32", "unsigned long long": "uint64"},
}


def skip(words: Iterator[str], opening: str, closing: str) -> None:
    """Pass over what lies between an opening word, just read, and its closing one."""
    depth = 1
    for word in words:
        depth += (word == opening) - (word == closing)
        if not depth:
            return


def statement(words: Iterator[str], first: str) -> list[str]:
    """The words up to the next semicolon, without annotations."""
    found = [first]
    for word in words:
        if word == ";":
            break
        found.append(word)
    return found


def declared(parts: list[str], aliases: dict[str, str]) -> tuple[str, str]:
    """Type, as .msg writes it, and name of a declaration: `sequence<double, 9> covariance`."""
    suffix = ""
    if parts[-1] == "]" and "[" in parts[1:]:  # name [ 36 ]
        at = parts.index("[", 1)
        parts, suffix = parts[:at], "".join(parts[at:])
    *kind, name = parts
    if kind[:2] == ["sequence", "<"]:
        kind, suffix = [word for word in kind[2:-1] if not word.isdigit() and word != ","], "[]"
    if kind[:2] == ["string", "<"]:
        kind = ["string"]
    text = " ".join(kind)
    plain = NAMES.get(text, text.lstrip(":").replace("::msg::", "/").replace("::", "/"))
    return aliases.get(plain.rpartition("/")[2], plain) + suffix, name


def idl_fields(text: str) -> Fields:
    """The fields of every structure: "package/Type" -> (type as in .msg files, name)."""
    words = (word for word in WORD.findall(text) if not word.lstrip().startswith(NOISE))
    found: Fields = {}
    aliases: dict[str, str] = {}
    scope: list[str] = []
    fields: list[tuple[str, str]] | None = None
    for word in words:
        if word == "@":
            next(words, "")
            continue  # its arguments, if any, come as a bracket
        if word == "(":
            skip(words, "(", ")")
        elif word in ("module", "struct"):
            scope.append(next(words, ""))
            if word == "struct":
                fields = found.setdefault("/".join((scope[0], scope[-1])), [])
        elif word == "}":
            fields = None
            scope = scope[:-1]
        elif word in ("{", ";"):
            continue
        else:
            parts = statement(words, word)
            if parts[0] == "typedef" and len(parts) > 2:
                kind, name = declared(parts[1:], aliases)
                aliases[name] = kind
            elif fields is not None and len(parts) > 1:
                fields.append(declared(parts, aliases))
    return found
