"""Flags that many verbs have, and how a verb ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import click

from formats.errors import Notes
from replay.cli.values import PoseType, answer, ending, say

Command = TypeVar("Command", bound=Callable[..., Any])

force_flag = click.option("--force", is_flag=True, help="Replace files that exist.")
json_flag = click.option("--json", "as_json", is_flag=True, help="One JSON object on stdout.")
quiet_flag = click.option("--quiet", is_flag=True, help="No progress bar, no hints.")
plan_method_flag = click.option(
    "--plan-method",
    type=click.Choice(["auto", "ink", "structural", "georgiou"]),
    help="auto (default) extracts the walls of drawings with door symbols; ink takes dark ink.",
)


map_frame_flag = click.option(
    "--map-frame", metavar="FRAME", help="The frame of the poses; map by default."
)
base_frame_flag = click.option(
    "--base-frame", metavar="FRAME", help="The robot's frame; base_link by default."
)
sensor_pose_flag = click.option(
    "--sensor-pose", type=PoseType(), help="Of the sensor in the base frame; else tf."
)


def file_flag(metavar: str, help: str, name: str = "output", **more: Any) -> Callable[..., Any]:
    """-o of a verb that writes one file, or into one folder.

    Args:
        metavar, help: as `--help` has them.
        name: of the command's parameter.
        more: whether it is required, its default.
    """
    kind = click.Path(path_type=Path)
    return click.option("-o", "--output", name, metavar=metavar, type=kind, help=help, **more)


def output_flag(default: str) -> Callable[[Command], Command]:
    """-o of a verb that writes several files.

    Args:
        default: what the files are called without it.
    """
    return click.option(
        "-o",
        "--output",
        metavar="DIR-or-STEM",
        type=click.Path(path_type=Path),
        help=f"A folder, or the stem of the files' names; {default} by default.",
    )


def given(options: Mapping[str, Any]) -> dict[str, Any]:
    """The options that were given; those that were not keep the library's defaults."""
    return {name: value for name, value in options.items() if value is not None}


def answered(
    verb: Callable[[Notes], dict[str, Any]],
    report: Callable[[dict[str, Any]], str],
    *,
    as_json: bool,
) -> int:
    """Do what a verb does, say what was odd, and print what it found; the exit code.

    Args:
        verb: takes the notes, returns what --json prints.
        report: the same for a person.
        as_json: which of the two.
    """
    notes = Notes()
    try:
        facts = verb(notes)
    finally:
        say(notes)
    if as_json:
        answer(facts)
    elif text := report(facts):
        click.echo(text)
    return ending(notes)


def wrote(facts: Mapping[str, Any]) -> str:
    """A line for each file."""
    return "\n".join(f"wrote   {path}" for path in facts["written"])
