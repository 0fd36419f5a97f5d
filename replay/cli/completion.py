"""`replay completion`: what a shell needs to complete verbs and options."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class


@click.command("completion")
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
@click.pass_context
def command(ctx: click.Context, shell: str) -> int:
    """Print the completion script of a SHELL.

    \b
    Examples:
      eval "$(replay completion bash)"       # in ~/.bashrc
      eval "$(replay completion zsh)"        # in ~/.zshrc
      replay completion fish > ~/.config/fish/completions/replay.fish
    """
    kind = get_completion_class(shell)
    assert kind is not None
    click.echo(kind(ctx.find_root().command, {}, "replay", "_REPLAY_COMPLETE").source())
    return 0
