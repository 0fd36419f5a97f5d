"""The command line: a thin shell over `replay`. Heavy imports wait inside the verbs."""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module
from typing import Any, NoReturn

import click

from formats.errors import FormatError

# verb -> what it does; each lives in the module of its name beside this one.
VERBS = {
    "run": "Map a log over the prior of a plan, and score the map.",
    "info": "Say what a log holds, and whether it can be used.",
    "plan": "Find walls, doors and outline in a drawing.",
    "align": "Find where a plan lies under a log or a map.",
    "deviation": "Say which walls of the plan stand, moved, or are not there.",
    "batch": "Run many logs into an archive of results; only what is missing.",
    "compare": "Hold archives, priors or curves against each other, log by log.",
    "rescore": "Score results under other priors, without their logs.",
    "tune": "Find the prior's values that suit results, or a plan, best.",
    "view": "Look at results in Rerun: a window, a browser, a picture.",
    "simulate": "Drive a simulated robot through a plan, and write its log with the truth.",
    "paper": "Reproduce the paper: its tables, its figures, its claims.",
    "report": "Write results as one HTML file.",
    "export": "Write maps, poses and scores of a result in the formats of others.",
    "demo": "Write a sample log with its plan, and say what to try.",
    "completion": "Print what a shell needs to complete verbs and options.",
}


class Verbs(click.Group):
    """Loads a verb's module only when it is asked for, so that --help answers at once."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The verbs in the order of the table."""
        return list(VERBS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The verb's command, or None where there is no such verb."""
        if cmd_name not in VERBS:
            return None
        from replay.cli.config import configured

        return configured(import_module(f"replay.cli.{cmd_name}").command)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The table itself, without importing a single verb."""
        with formatter.section("Verbs"):
            formatter.write_dl(list(VERBS.items()))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does it, with a guess for a mistyped verb."""
        if args and args[0] not in VERBS and not args[0].startswith("-"):
            from difflib import get_close_matches

            close = get_close_matches(args[0], VERBS, 1)
            hint = f" Did you mean {close[0]}?" if close else ""
            ctx.fail(f"No such verb: {args[0]}.{hint}")
        return super().resolve_command(ctx, args)


@click.command(cls=Verbs, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="plan-replay", prog_name="replay")
def cli() -> None:
    """Replay robot logs against a prior drawn from the building's architectural plan.

    \b
    Examples:
      replay run turtlebot.mcap --prior plan.png
      replay run drive.bag --prior plan.yaml --truth truth.png --view
      replay export turtlebot.replay.mcap
    """


def main(arguments: list[str] | None = None) -> NoReturn:
    """The one error boundary: a line for what the user can mend, a traceback for a bug.

    Exit codes: 0 done, 1 failed, 2 wrong usage, 3 done but input data were lost, 130 interrupted.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # saves 100 ms of CPU; no BLAS is used
    if hasattr(signal, "SIGTERM"):
        signal.signal(signal.SIGTERM, signal.default_int_handler)  # no half file on `kill` either
    sys.exit(_exit_code(arguments))


def _exit_code(arguments: list[str] | None) -> int:
    try:
        code: Any = cli.main(args=arguments, prog_name="replay", standalone_mode=False)
        sys.stdout.flush()
        return int(code or 0)
    except FormatError as error:
        click.echo(f"replay: {error}", err=True)
        return error.exit_code
    except click.exceptions.Abort:
        click.echo("replay: interrupted; nothing was written", err=True)
        return 130
    except KeyboardInterrupt:
        click.echo("replay: interrupted; nothing was written", err=True)
        return 130
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except (BrokenPipeError, SystemExit):  # the latter is click's answer to a closed pipe
        # `| head` closed the pipe: be quiet, also at the interpreter's own last flush
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
