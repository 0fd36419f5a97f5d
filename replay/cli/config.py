"""--config FILE and --print-config, for every verb that has options.

Order: a flag, else the file, else the default. The file is TOML: options by their names, at the
top for whatever verb reads it, or in a table of the verb's name for it alone.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from formats.errors import UsageError

OURS = ("help", "config", "print_config", "version")
WITH_DEFAULTS = ("run", "batch")  # None stands for the default of replay.options there


class Configured(click.Command):
    """A verb that takes its options from a file, too."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click does it; with --print-config nothing is required, and nothing else is done."""
        if "--print-config" not in args or "--help" in args or "-h" in args:
            return super().parse_args(ctx, args)
        required = [param for param in self.params if param.required]
        for param in required:
            param.required = False
        try:
            super().parse_args(ctx, [word for word in args if word != "--print-config"])
        finally:
            for param in required:
                param.required = True
        click.echo(printed(self, ctx.params), nl=False)
        raise click.exceptions.Exit(0)


def configured(command: click.Command) -> click.Command:
    """The same verb with --config and --print-config, if it has options that a file could set."""
    if isinstance(command, click.Group) or not settable(command):
        return command
    if any(param.name == "config" for param in command.params):
        return command
    command.__class__ = Configured
    command.params += [
        click.Option(
            ["--config"],
            metavar="FILE",
            type=click.Path(path_type=Path),
            is_eager=True,
            expose_value=False,
            callback=_load,
            help="Options by their names, as TOML; flags go before it.",
        ),
        click.Option(
            ["--print-config"],
            is_flag=True,
            expose_value=False,
            help="Print the options that would hold, as such a file.",
        ),
    ]
    return command


def settable(command: click.Command) -> dict[str, click.Option]:
    """Options that a file may set, by their names."""
    options = [param for param in command.params if isinstance(param, click.Option)]
    return {str(o.name): o for o in options if o.name not in OURS}


def _load(ctx: click.Context, param: click.Parameter, value: Path | None) -> None:
    """Makes what the file says the defaults of this verb."""
    if value is not None:
        known = settable(ctx.command)
        ctx.default_map = {
            **(ctx.default_map or {}),
            **read_config(value, str(ctx.command.name), known),
        }


def read_config(path: Path, verb: str, known: Mapping[str, click.Option]) -> dict[str, Any]:
    """What a file says to a verb, by the names of click's parameters.

    Raises:
        UsageError: it cannot be read, is no TOML, or has a key that the verb does not know.
    """
    try:
        found = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(path, f"cannot be read: {error.strerror or error}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(path, f"is not TOML: {error}") from error
    top = {key: value for key, value in found.items() if not isinstance(value, dict)}
    own = found.get(verb, {})
    return {
        _known(path, key, known): _said(value)
        for key, value in {**top, **(own if isinstance(own, dict) else {})}.items()
    }


def _known(path: Path, key: str, known: Mapping[str, click.Option]) -> str:
    """The parameter of a key, which may have hyphens or underscores."""
    flags = {flag.lstrip("-"): name for name, option in known.items() for flag in option.opts}
    name = flags.get(key.replace("_", "-"), key.replace("-", "_"))
    if name in known:
        return name
    from difflib import get_close_matches

    close = get_close_matches(key.replace("_", "-"), flags, 1)
    raise UsageError(path, f"no option {key!r}", hint=f"did you mean {close[0]}?" if close else "")


def _said(value: Any) -> Any:
    """As it would be said on the command line: a pose as X,Y,YAW."""
    if isinstance(value, list) and all(isinstance(item, int | float) for item in value):
        return ",".join(f"{item:g}" for item in value)
    return value


def printed(command: click.Command, values: Mapping[str, Any]) -> str:
    """A file that sets what holds; what has no value is a comment."""
    defaults: Mapping[str, Any] = {}
    if command.name in WITH_DEFAULTS:
        from replay.options import DEFAULTS

        defaults = DEFAULTS
    lines = [f"# replay {command.name}: a flag goes before this file, this file before the default"]
    for name, option in settable(command).items():
        key = max(option.opts, key=len).lstrip("-")
        value = values.get(name)
        value = defaults.get(name) if value is None else value
        text = _toml(value)
        lines.append(f"# {key} =" if text is None else f"{key} = {text}")
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str | None:
    """A value as TOML; None where there is none."""
    if value is None or value == ():
        return None
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return f"{value!r}"
    if isinstance(value, tuple) and all(isinstance(item, int | float) for item in value):
        value = ",".join(f"{item:g}" for item in value)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(str(_toml(item)) for item in value) + "]"
    text = str(value).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{text}"'
