"""Verbs: what one does with logs, plans and results. `from replay import run`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

# public name -> the module that has it; loaded when it is first asked for
PUBLIC = {
    "run": "replay.running",
    "steps": "replay.pipeline",
    "export": "replay.exporting",
    "plan": "replay.planning.extracting",
    "simulate": "replay.simulator.simulating",
    "demo": "replay.samples",
    "inspect": "replay.inspecting.contents",
    "deviation": "replay.surveying.deviating",
    "batch": "replay.archive.batching",
    "report": "replay.reporting.writing",
    "compare": "replay.archive.comparing",
    "rescore": "replay.archive.rescored",
    "results": "replay.archive.table_of_results",
    "tune": "replay.tuning.finding",
    "view": "replay.viewing.looking",
    "paper": "replay.reproduction.reproducing",
}
__all__ = [
    "batch",
    "compare",
    "demo",
    "deviation",
    "export",
    "inspect",
    "paper",
    "plan",
    "report",
    "rescore",
    "results",
    "run",
    "simulate",
    "steps",
    "tune",
    "view",
]


def __getattr__(name: str) -> Any:
    if name in PUBLIC:
        return getattr(import_module(PUBLIC[name]), name)
    raise AttributeError(f"module 'replay' has no attribute {name!r}")
