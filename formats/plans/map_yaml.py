"""map_server's yaml: values with their line and column, refused in one line as nav2 does."""

from __future__ import annotations

import codecs
import difflib
import re
from dataclasses import dataclass
from math import isfinite
from typing import Literal, NoReturn, Protocol, cast, get_args

import yaml
from yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from formats.errors import FormatError, Notes, printable
from formats.errors import Path as AnyPath
from formats.frame import Pose

Mode = Literal["trinary", "scale", "raw"]
MODES: tuple[str, ...] = get_args(Mode)
LONGEST = 65_536
DEEPEST = 20
FINEST, COARSEST = 1e-5, 100.0  # m a pixel
KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode")
NAV2_KEYS = ("elevation_image", "min_height", "max_height", "octomap_file", "binary")
USUAL = {
    "resolution": "0.05",
    "origin": "[0.0, 0.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}
TRUE = ("1", "true", "yes", "on", "y")
FALSE = ("0", "false", "no", "off", "n")
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
NOT_FINITE = re.compile(r"[-+]?\.?(inf|infinity)|\.?nan", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class MapYaml:
    """What a map's yaml says.

    Attributes:
        image: as written, "" where it is missing.
        resolution: m a pixel.
        origin: pose of the picture's lower left corner: m, m, rad.
        negate: white is occupied.
        occupied_thresh, free_thresh: of P(occupied).
        mode: "trinary", "scale" or "raw".
    """

    image: str
    resolution: float
    origin: Pose
    negate: bool
    occupied_thresh: float
    free_thresh: float
    mode: Mode


class Faulty:
    """One yaml's text and name: finds values, and says where they are wrong."""

    def __init__(self, path: AnyPath) -> None:
        self.path = path

    def fail(self, node: Node | None, problem: str, hint: str = "") -> NoReturn:
        """Raise the one line: `file:line:column: problem; hint`, counted from 1."""
        at = "" if node is None else place(node.start_mark)
        raise FormatError(f"{printable(self.path)}{at}", problem, hint=hint)

    def text(self, key: str, node: Node) -> str:
        """A scalar as written."""
        if not isinstance(node, ScalarNode):
            self.fail(node, f"{key} must be one value, not a list or mapping")
        return str(node.value).strip()

    def number(self, key: str, node: Node) -> float:
        """A finite number; 1e-2 is one too, though YAML 1.1 has it as text."""
        text = self.text(key, node)
        if NOT_FINITE.fullmatch(text):
            self.fail(node, f"{key} is {text}, not a finite number")
        if not NUMBER.fullmatch(text) or not isfinite(float(text)):
            self.fail(node, f"{key} must be a number, not {text!r}")
        return float(text)

    def resolution(self, node: Node) -> float:
        """Metres a pixel, positive and within reason."""
        value = self.number("resolution", node)
        if value <= 0:
            self.fail(node, f"resolution must be positive, not {value:g}", "give m per pixel")
        if not FINEST <= value <= COARSEST:
            self.fail(node, f"resolution of {value:g} m a pixel is beyond reason")
        return value

    def origin(self, node: Node) -> Pose:
        """x, y, yaw: exactly three numbers, as nav2 wants them."""
        if not isinstance(node, SequenceNode):
            self.fail(node, "origin must be a list [x, y, yaw]")
        if len(node.value) != 3:
            self.fail(node, f"origin must have 3 elements [x, y, yaw], not {len(node.value)}")
        return Pose(*(self.number("origin", element) for element in node.value))

    def flag(self, key: str, node: Node) -> bool:
        """0, 1 or a word for them."""
        text = self.text(key, node).lower()
        if text not in TRUE + FALSE:
            self.fail(node, f"{key} must be 0 or 1, not {text!r}")
        return text in TRUE

    def threshold(self, key: str, node: Node) -> float:
        """A probability."""
        value = self.number(key, node)
        if not 0 <= value <= 1:
            self.fail(node, f"{key} must lie in 0 to 1, not {value:g}")
        return value

    def mode(self, node: Node | None) -> Mode:
        """Trinary where nothing is said."""
        text = "trinary" if node is None else self.text("mode", node)
        if text not in MODES:
            self.fail(node, f"mode {text!r} is unknown", f"one of {', '.join(MODES)}")
        return cast(Mode, text)


class Mark(Protocol):
    """A place in a yaml text, counted from 0."""

    line: int
    column: int


def place(mark: Mark | None) -> str:
    """`:line:column`, counted from 1."""
    return "" if mark is None else f":{mark.line + 1}:{mark.column + 1}"


def read_map_yaml(path: AnyPath, data: bytes, notes: Notes, *, picture: bool = False) -> MapYaml:
    """The values of a map_server yaml, ROS 1 and nav2.

    Args:
        path: its name, for messages.
        data: its bytes; UTF-8 or UTF-16 with a byte order mark.
        notes: unknown keys.
        picture: the picture is known already, so that `image` may be missing.

    Raises:
        FormatError: one line with file, line and column.
    """
    faulty = Faulty(path)
    root = compose(path, decoded(path, data))
    if not isinstance(root, MappingNode):
        faulty.fail(root, "is not a mapping of keys to values, so no map yaml")
    nodes = keyed(faulty, root)
    for key in nodes:
        if key not in KEYS + NAV2_KEYS:
            near = difflib.get_close_matches(key, KEYS, 1)
            guess = f"; did you mean {near[0]}?" if near else ""
            notes.warn(path, f"key {printable(key, 40)!r} is unknown and ignored{guess}")
    for key in KEYS[:-1]:
        if key not in nodes and not (key == "image" and picture):
            usual = f"add `{key}: {USUAL[key]}`" if key in USUAL else "name the picture"
            faulty.fail(None, f"the map yaml has no {key}", usual)
    image = faulty.text("image", nodes["image"]) if "image" in nodes else ""
    if "image" in nodes and not image:
        faulty.fail(nodes["image"], "image is empty", "name the picture")
    occupied = faulty.threshold("occupied_thresh", nodes["occupied_thresh"])
    free = faulty.threshold("free_thresh", nodes["free_thresh"])
    if free >= occupied:
        problem = f"free_thresh {free:g} is not below occupied_thresh {occupied:g}"
        faulty.fail(nodes["free_thresh"], problem)
    return MapYaml(
        image,
        faulty.resolution(nodes["resolution"]),
        faulty.origin(nodes["origin"]),
        faulty.flag("negate", nodes["negate"]),
        occupied,
        free,
        faulty.mode(nodes.get("mode")),
    )


def decoded(path: AnyPath, data: bytes) -> str:
    """The text: UTF-8 with or without a byte order mark, UTF-16 with one."""
    if not data.strip():
        raise FormatError(path, "the map yaml is empty")
    if len(data) > LONGEST:
        raise FormatError(path, f"{len(data):,} bytes are too many for a map yaml")
    utf16 = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        return data.decode("utf-16" if utf16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start)
        column = error.start - (data.rfind(b"\n", 0, error.start) + 1)
        at = f":{line + 1}:{column + 1}"
        raise FormatError(f"{printable(path)}{at}", "is not text in UTF-8") from None


def compose(path: AnyPath, text: str) -> Node | None:
    """The node tree, without objects made of it; aliases and foreign tags are refused.

    Raises:
        FormatError: faults of the syntax, with line and column.
    """
    depth = 0
    try:
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            at = f"{printable(path)}{place(event.start_mark)}"
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > DEEPEST:  # PyYAML's time grows with the square of the depth
                raise FormatError(at, "the map yaml is nested too deeply")
            if isinstance(event, yaml.AliasEvent):
                raise FormatError(at, f"alias *{printable(event.anchor, 40)} is refused")
            tag = getattr(event, "tag", None)
            if tag not in (None, "!") and tag not in yaml.SafeLoader.yaml_constructors:
                raise FormatError(at, f"tag {printable(tag, 60)} is refused")
        return yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.MarkedYAMLError as error:
        at = place(error.problem_mark or error.context_mark)
        what = error.problem or error.context or "is no yaml"
        raise FormatError(f"{printable(path)}{at}", printable(what)) from None
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position)
        column = error.position - (text.rfind("\n", 0, error.position) + 1)
        at = f":{line + 1}:{column + 1}"
        raise FormatError(f"{printable(path)}{at}", "holds a character that yaml forbids") from None


def keyed(faulty: Faulty, root: MappingNode) -> dict[str, Node]:
    """Values by key; a key given twice is refused."""
    nodes: dict[str, Node] = {}
    for key_node, node in root.value:
        key = faulty.text("a key", key_node)
        if key in nodes:
            faulty.fail(key_node, f"key {printable(key, 40)!r} is given twice")
        nodes[key] = node
    return nodes
