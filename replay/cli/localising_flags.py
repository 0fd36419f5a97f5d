"""Flags of localisation, by nav2_amcl's names; docs/poses.md explains each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from replay.localise.options import DEFAULTS

Command = TypeVar("Command", bound=Callable[..., Any])
OLDER = {"pf_err": "--kld-err", "pf_z": "--kld-z"}  # what ROS 1's amcl calls them


def localising_flags(command: Command) -> Command:
    """A flag for each option; out of sight in `--help`, which would be twice as long."""
    for name, default in reversed(DEFAULTS.items()):
        flags = ["--" + name.replace("_", "-"), *filter(None, [OLDER.get(name)])]
        if name == "laser_model_type":
            kind: Any = click.Choice(["likelihood_field", "beam"])
        else:
            kind = type(default)
        command = click.option(*flags, name, type=kind, hidden=True)(command)
    return command
