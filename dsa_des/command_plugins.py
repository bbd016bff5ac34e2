"""Commands that packages add to ``dsa-des``: entry-point group ``dsa_des.commands``.

Each entry point is a `click.Command` in a module that imports click only, so that ``--help`` stays
instant: a command imports what it needs when it is called.
"""

from typing import Any

import click

from dsa_des.entry_points import registered

COMMANDS = "dsa_des.commands"


class PluginGroup(click.Group):
    """A command group whose registered commands are loaded when they are named or listed."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return our own commands and the registered ones, sorted."""
        return sorted({*super().list_commands(ctx), *registered(COMMANDS)})

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return one command, our own first."""
        own = super().get_command(ctx, cmd_name)
        if own is not None or cmd_name not in registered(COMMANDS):
            return own
        from dsa_des.foreign import installed

        found: Any = installed(registered(COMMANDS)[cmd_name])
        if not isinstance(found, click.Command):
            raise click.ClickException(
                f"the registered command {cmd_name!r} is not a click.Command"
            )
        return found
