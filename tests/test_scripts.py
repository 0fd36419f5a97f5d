"""Scripts that measure: they run, and what they measure holds."""

from __future__ import annotations

import ast

import pytest

from scripts import licences, score_damage
from scripts.mutants import TARGETS, changed, changes


@pytest.mark.slow
def test_cut_recordings(capsys: pytest.CaptureFixture[str]) -> None:
    assert score_damage.main(["--cuts", "4"]) == 0
    rows = [line.split("|") for line in capsys.readouterr().out.splitlines()[2:]]
    assert [row[1].strip() for row in rows] == list(score_damage.CASES)
    assert all(int(row[2]) > score_damage.SCANS for row in rows)


def test_every_locked_package_has_its_licence_in_the_docs() -> None:
    rows = licences.PAGE.read_text().splitlines()
    assert [row.split("|")[1].strip() for row in rows if row.startswith("| ")][1:] == (
        licences.locked()
    )


def test_mutants_differ_by_one_change_each() -> None:
    source = """
def f(x: int = 2) -> int:
    'A docstring stays.'
    while x > 1 and not x % 2:
        x -= min(x, 3)
        if x == 5:
            continue
        print(x)
    if x < 0:
        raise ValueError(-x)
    return x
"""
    tree = ast.parse(source)
    before = ast.unparse(tree)
    found = [changed(tree, index, kind) for index, kind in changes(tree)]
    assert ast.unparse(tree) == before
    texts = [ast.unparse(mutant) for mutant in found]
    assert len(set(texts)) == len(texts) == len(changes(tree)) == 20
    assert all(text != before and "A docstring stays." in text for text in texts)
    assert before.replace("x > 1", "x >= 1") in texts
    assert before.replace("x -= min(x, 3)", "x -= max(x, 3)") in texts
    assert before.replace("continue", "break") in texts
    assert before.replace("return x", "return None") in texts
    assert before.replace("print(x)", "None") in texts


@pytest.mark.parametrize("name", TARGETS)
def test_modules_and_tests_of_mutants_are_there(name: str) -> None:
    target = TARGETS[name]
    modules = [module.replace(".", "/") + ".py" for module in target.modules]
    assert all((licences.ROOT / path).exists() for path in [*modules, *target.tests])
