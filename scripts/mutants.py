"""Breaks the arithmetic on purpose, one small change at a time, and counts what the tests notice.

    python -m scripts.mutants                     every target, a seeded sample of each
    python -m scripts.mutants grid front          some of them
    python -m scripts.mutants tf --sample 300 --seed 1

A mutant is a module with one operator, comparison, number, condition or call changed (`changes`).
It is never written to disk: a forked child imports the changed tree in the module's place and runs
the target's tests until one fails. Kernels run as plain Python where they are what is changed,
since machine code in the cache would hide it. A mutant that is not caught is printed with its line;
those that no test can catch are listed in EQUIVALENT, each with its reason.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib.abc
import importlib.util
import os
import random
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent


class Target(NamedTuple):
    """What is changed, the tests that should notice, and whether kernels compile."""

    modules: tuple[str, ...]
    tests: tuple[str, ...]
    compiled: bool = True


TARGETS = {
    "grid": Target(("formats.grid",), ("tests/formats/test_grid.py", "tests/replay/test_prior.py")),
    "scoring": Target(
        ("replay.scoring.scorer",),
        ("tests/replay/scoring/test_scorer.py",),
    ),
    "scoring-kernels": Target(
        ("replay.scoring.kernels",), ("tests/replay/scoring/test_scorer.py",), compiled=False
    ),
    "sensor": Target(
        ("replay.sensors.observer", "replay.sensors.models"),
        ("tests/replay/sensors", "tests/replay/test_mapper.py"),
    ),
    "sensor-kernels": Target(
        (
            "replay.sensors.kernels",
            "replay.sensors.fan",
            "replay.sensors.fill",
            "replay.sensors.polar",
        ),
        ("tests/replay/sensors",),
        compiled=False,
    ),
    "prior": Target(
        ("replay.prior",), ("tests/replay/test_prior.py", "tests/formats/test_prior_values.py")
    ),
    "tf": Target(
        ("formats.streaming.tf", "formats.streaming.track"),
        ("tests/formats/test_tf.py", "tests/formats/test_tf_faults.py"),
    ),
    "front": Target(
        ("replay.tuning.front", "replay.tuning.surfaces", "replay.tuning.flips"),
        (
            "tests/replay/tuning/test_front_by_hand.py",
            "tests/replay/tuning/test_flips.py",
            "tests/replay/tuning/test_front.py",
        ),
        compiled=False,
    ),
}

NEVER = "no sum of logarithms meets that constant to the bit"
MEANINGLESS = "a track without samples has no pose, whatever stands there"
EQUIVALENT: dict[tuple[str, str, str], str] = {
    (
        "formats.grid",
        "return log(p / (1.0 - p)) if p > 0.5 else -logit(1.0 - p)",
        "condition turned",
    ): "antisymmetric from the other side; values differ by a rounding at most",
    (
        "formats.grid",
        "return log(p / (1.0 - p)) if p > 0.5 else -logit(1.0 - p)",
        "Gt -> GtE",
    ): "0.5 has been answered a line above",
    (
        "formats.grid",
        "if size > SAME and (not sizes or size > sizes[-1] * (1.0 + SAME)):",
        "Gt -> GtE",
    ): NEVER,
    (
        "formats.grid",
        "signs[m, level] = 1 if weight > 0 else -1",
        "Gt -> GtE",
    ): "a weight of 0 has no magnitude, so it does not come here",
    (
        "formats.streaming.tf",
        'odd["another static value (the last one counts)"] = 1',
        "1 -> 2",
    ): "that it is there is what counts",
    (
        "formats.streaming.tf",
        "def settle(self, clock: Clock, zero_ns: int = 0, max_gap_ns: int = MAX_GAP_NS) -> None:",
        "0 -> 1",
    ): "notes say hundredths of a second",
    (
        "formats.streaming.track",
        "return bool(still) and bool(np.all(np.abs(turns @ turns[0]) >= STEADY_DOT))",
        "GtE -> Gt",
    ): NEVER,
    (
        "formats.streaming.track",
        "identity = np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(times_ns), 1))",
        "0.0 -> 1.0",
    ): MEANINGLESS,
    (
        "formats.streaming.track",
        "identity = np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(times_ns), 1))",
        "0 -> 1",
    ): MEANINGLESS,
    (
        "formats.streaming.track",
        "scaled = turned & placed & (off > UNIT)",
        "Gt -> GtE",
    ): "no norm near 1 is off by that constant to the bit",
    (
        "formats.streaming.track",
        "a = np.where(near, 1.0 - share, np.sin((1.0 - share) * angle) / safe)",
        "1.0 -> 2.0",
    ): "both turns are the same there, and their sum is normalised",
    (
        "formats.streaming.track",
        "turned /= np.linalg.norm(turned, axis=1, keepdims=True)",
        "Div -> Mult",
    ): "it takes off a rounding, which squares",
    (
        "replay.scoring.scorer",
        "self._readings = 0 if seen is None else int(seen.max(initial=0))",
        "0 -> 1",
    ): "only how soon sums are no more surely told apart by their size",
    ("replay.scoring.scorer", "self._readings += 1", "1 -> 2"): "as above",
    ("replay.scoring.scorer", "self._readings += 1", "Add -> Sub"): "as above",
    (
        "replay.scoring.scorer",
        "self._words |= np.where(scored, SCORED, 0).ravel().astype(np.uint32)",
        "0 -> 1",
    ): "a cell that is not scored is never counted, whatever its bit of the first curve",
    (
        "replay.tuning.flips",
        "NOTHING = Flips(np.zeros(0), np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))",
        "1 -> 2",
    ): "no flip: only the first place is ever asked for",
    (
        "replay.tuning.flips",
        "strip = Geometry(1, cells.counts.shape[1], 1.0, 0.0, 0.0)",
        "1 -> 2",
    ): "the counts are one row, which numpy repeats",
    (
        "replay.tuning.flips",
        "strip = Geometry(1, cells.counts.shape[1], 1.0, 0.0, 0.0)",
        "0.0 -> 1.0",
    ): "where the strip lies is never asked for",
    (
        "replay.tuning.flips",
        "change = np.zeros(2 * len(places) + 2, dtype=np.int64)",
        "2 -> 3",
    ): "a longer tail that repeats the last sum and is never asked for",
    (
        "replay.scoring.kernels",
        "SURE, FEW = 1e-6, 1_000_000",
        "1e-06 -> 1.000001",
    ): "more sums are looked at twice, with the same answer",
    ("replay.scoring.kernels", "BLOCK = 32", "32 -> 33"): "how many are worked on at once",
    (
        "replay.tuning.front",
        "if width_a[i] * width_b[j] <= width_a[k] * width_b[m]:",
        "LtE -> Lt",
    ): "of choices that are as wide any will do",
    ("replay.tuning.front", "if y < ceiling:", "Lt -> LtE"): "an area of 0 more",
    (
        "replay.tuning.front",
        "inside = objectives[(objectives < reference).all(axis=1)]",
        "Lt -> LtE",
    ): "an area of 0 more",
    (
        "replay.tuning.surfaces",
        "tp, fp = (w + s + f for w, s, f in zip(walls, spaces, self.fixed, strict=True))",
        "True -> False",
    ): "each is a pair",
    (
        "replay.tuning.surfaces",
        "for w, s, fixed in zip(walls, spaces, self.fixed, strict=True)",
        "True -> False",
    ): "each is a pair",
    (
        "replay.tuning.surfaces",
        "return np.round(np.linspace(low, high, steps), 12)",
        "12 -> 13",
    ): "enough for 0.3 to be 0.3 either way",
    (
        "formats.grid",
        "for size, row in zip(sizes, signs, strict=True):",
        "True -> False",
    ): "both are made side by side by `terms`",
}
"""(module, source line, change) -> why no test can tell it from the original."""

COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Div,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitAnd,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
}
CALLED = {
    "min": "max",
    "max": "min",
    "floor": "ceil",
    "ceil": "floor",
    "minimum": "maximum",
    "maximum": "minimum",
    "any": "all",
    "all": "any",
    "argmin": "argmax",
    "argmax": "argmin",
    "sin": "cos",
    "cos": "sin",
}


def parts(node: ast.AST) -> Iterator[ast.AST]:
    """What runs: no docstring, annotation, decorator, or wording of an error."""
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "type_params"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or isinstance(child, ast.Raise | ast.JoinedStr):
                continue
            if isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant):
                continue
            yield child
            yield from parts(child)


def changes(tree: ast.Module) -> list[tuple[int, str]]:
    """(index of the node among `parts`, kind of change), in the order of the source."""
    found = []
    for index, node in enumerate(parts(tree)):
        found += [(index, kind) for kind in kinds(node)]
    return found


def kinds(node: ast.AST) -> Iterator[str]:
    """The changes that a node allows, each said as it will be printed."""
    match node:
        case ast.Compare(ops=[op]) if type(op) in COMPARED:
            yield f"{type(op).__name__} -> {COMPARED[type(op)].__name__}"
        case ast.BinOp(op=op) | ast.AugAssign(op=op) if type(op) in COMPUTED:
            yield f"{type(op).__name__} -> {COMPUTED[type(op)].__name__}"
        case ast.BoolOp(op=ast.And()):
            yield "and -> or"
        case ast.BoolOp(op=ast.Or()):
            yield "or -> and"
        case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert() as op):
            yield f"without {type(op).__name__}"
        case ast.Constant(value=bool() as value):
            yield f"{value} -> {not value}"
        case ast.Constant(value=int() | float() as value):
            yield f"{value} -> {value + 1}"
        case ast.If() | ast.While() | ast.IfExp():
            yield "condition turned"
        case ast.Return(value=ast.expr() as value) if ast.unparse(value) != "None":
            yield "return None"
        case ast.Continue():
            yield "continue -> break"
        case ast.Break():
            yield "break -> continue"
        case ast.Expr(value=ast.Call()):
            yield "call left out"
        case ast.Name(id=name) | ast.Attribute(attr=name) if name in CALLED:
            yield f"{name} -> {CALLED[name]}"


def changed(tree: ast.Module, index: int, kind: str) -> ast.Module:
    """A copy of the tree with one change."""
    tree = copy.deepcopy(tree)
    node = list(parts(tree))[index]
    match node:
        case ast.Compare():
            node.ops = [COMPARED[type(node.ops[0])]()]
        case ast.BinOp() | ast.AugAssign():
            node.op = COMPUTED[type(node.op)]()
        case ast.BoolOp():
            node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        case ast.UnaryOp():
            node.op = ast.UAdd()
            if kind.endswith("Not"):
                node.op, node.operand = ast.Not(), ast.UnaryOp(ast.Not(), node.operand)
        case ast.Constant(value=bool() as value):
            node.value = not value
        case ast.Constant(value=int() | float() as value):
            node.value = value + 1
        case ast.If() | ast.While() | ast.IfExp():
            node.test = ast.UnaryOp(ast.Not(), node.test)
        case ast.Return():
            node.value = ast.Constant(None)
        case ast.Expr():
            node.value = ast.Constant(None)
        case ast.Name():
            node.id = CALLED[node.id]
        case ast.Attribute():
            node.attr = CALLED[node.attr]
        case ast.Continue() | ast.Break():
            return swapped(tree, node)
    return ast.fix_missing_locations(tree)


def swapped(tree: ast.Module, old: ast.stmt) -> ast.Module:
    """`continue` for `break` or the other way."""

    class Swap(ast.NodeTransformer):
        def generic_visit(self, node: ast.AST) -> ast.AST:
            if node is old:
                return ast.Break() if isinstance(node, ast.Continue) else ast.Continue()
            return super().generic_visit(node)

    return ast.fix_missing_locations(Swap().visit(tree))


class Instead(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports a changed tree in a module's place."""

    def __init__(self, name: str, path: Path, tree: ast.Module) -> None:
        self.name, self.path, self.tree = name, path, tree

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Ours for that one name."""
        if fullname != self.name:
            return None
        return importlib.util.spec_from_file_location(fullname, self.path, loader=self)

    def create_module(self, spec: ModuleSpec) -> None:
        """As any module."""

    def exec_module(self, module: ModuleType) -> None:
        """Run the changed tree."""
        # Names that CALLED may put in a call and the module does not import.
        exec("from math import ceil, cos, floor, sin", module.__dict__)
        exec(compile(self.tree, str(self.path), "exec"), module.__dict__)


def noticed(target: Target, instead: Instead | None, seconds: float) -> str:
    """'killed', 'survived' or 'too long', by a child that runs the tests until one fails."""
    pid = os.fork()
    if pid == 0:
        os.setsid()
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        code = 9
        try:
            import pytest

            if instead is not None:
                sys.meta_path.insert(0, instead)
            settings = ["-x", "-q", "-p", "no:cacheprovider", "-W", "ignore"]
            code = int(pytest.main([*settings, *target.tests]))
        finally:
            os._exit(code)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return "survived" if os.waitstatus_to_exitcode(status) == 0 else "killed"
        time.sleep(0.02)
    os.killpg(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    return "too long"


def run(name: str, sample: int, seed: int) -> None:
    """Change a target's modules and print what was noticed, survivors by line."""
    target = TARGETS[name]
    if not target.compiled:
        os.environ["NUMBA_DISABLE_JIT"] = "1"
    import cv2  # noqa: F401  (loaded once, before the forks)
    import hypothesis  # noqa: F401
    import numba  # noqa: F401
    import pytest  # noqa: F401
    import scipy.ndimage  # noqa: F401

    start = time.monotonic()
    if noticed(target, None, 900.0) != "survived":
        raise SystemExit(f"{name}: the tests fail as they are")
    limit = 10.0 + 4.0 * (time.monotonic() - start)
    sources = {}
    every = []
    for module in target.modules:
        path = ROOT / (module.replace(".", "/") + ".py")
        text = path.read_text()
        sources[module] = path, text.splitlines(), ast.parse(text)
        every += [(module, index, kind) for index, kind in changes(sources[module][2])]
    chosen = every
    if len(every) > sample:
        chosen = sorted(random.Random(seed).sample(every, sample))
    tally = {"killed": 0, "survived": 0, "too long": 0, "equivalent": 0}
    for module, index, kind in chosen:
        path, lines, tree = sources[module]
        node = list(parts(tree))[index]
        line = getattr(node, "lineno", 1)
        source = lines[line - 1].strip()
        if (module, source, kind) in EQUIVALENT:
            tally["equivalent"] += 1
            continue
        how = noticed(target, Instead(module, path, changed(tree, index, kind)), limit)
        tally[how] += 1
        if how == "survived":
            column = getattr(node, "col_offset", 0)
            print(f"  {path.relative_to(ROOT)}:{line}:{column}: {kind}: {source}", flush=True)
    told = tally["killed"] + tally["too long"]
    share = told / max(len(chosen) - tally["equivalent"], 1)
    print(
        f"{name}: {told} of {len(chosen) - tally['equivalent']} noticed ({share:.1%}; "
        f"{tally['too long']} by the time limit), {tally['equivalent']} equivalent, "
        f"{len(chosen)} of {len(every)} mutants tried",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--sample", type=int, default=150, help="mutants of a target at most")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    for name in options.targets or TARGETS:
        pid = os.fork()  # a process each: whether kernels compile is settled at numba's import
        if pid == 0:
            try:
                run(name, options.sample, options.seed)
            finally:
                sys.stdout.flush()
                os._exit(0)
        os.waitpid(pid, 0)


if __name__ == "__main__":
    main()
