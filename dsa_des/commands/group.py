"""The command group ``dsa-des``: plain errors, and commands that packages add to it.

Those are entry points of the group ``dsa_des.commands``. Each is a `click.Command` in a module that
imports click only, so that ``--help`` stays instant: a command imports what it needs when it is
called. Every error that a user can cause is one message and an exit code.
"""

import functools
import os
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import click

from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.foreign_calls import error_text_with_type, module_of_error
from dsa_des.errors import BlockFailure, OutputError, SceneError, UsageError
from dsa_des.terminal.interruption import exit_plainly_on_signal
from dsa_des.terminal.terminal import say, say_lines
from dsa_des.text.safe_text import escape_unprintable

# Packages whose code may end a command; an exit from any other is an error.
_OURS = ("dsa_des", "components", "click", "rich")


def plain_errors(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command so wrapped that user errors print one message, no traceback, and exit."""

    @functools.wraps(command)
    def guarded(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except (SceneError, UsageError) as error:
            say_lines(f"error: {error}", err=True)
            sys.exit(2)
        except (BlockFailure, OutputError) as error:
            context = click.get_current_context(silent=True)
            if context is not None and context.meta.get(_TRACEBACK) and error.__cause__ is not None:
                say_lines("".join(traceback.format_exception(error.__cause__)).rstrip(), err=True)
            say_lines(f"error: {error}", err=True)
            sys.exit(getattr(error, "exit_code", 1))
        except SystemExit as error:
            module = module_of_error(error.__traceback__)
            if module.partition(".")[0] in _OURS:
                raise
            say(f"error: the module {module!r} left with {error_text_with_type(error)}", err=True)
            sys.exit(2)
        except BrokenPipeError:  # the reader of our output went away
            sys.stderr.close()
            sys.exit(1)

    return guarded


@contextmanager
def exit_on_write_error() -> Iterator[None]:
    """If a file or output cannot be written inside the context, print one line; exit with 1."""
    try:
        try:
            yield
        finally:
            sys.stdout.flush()  # now, where an error can be reported, and not when Python ends
    except OSError as error:
        # What is left in the buffer is written when Python ends, and must not fail again.
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, sys.stdout.fileno())
            os.close(nowhere)
        if not isinstance(error, BrokenPipeError):
            what = error.filename or "the output cannot be written"
            with suppress(OSError, ValueError):
                say(f"error: {what}: {error.strerror or error}", err=True)
        sys.exit(1)


COMMANDS = "dsa_des.commands"
# What click (from 8.2 on) raises where a command is missing: its message is the whole help.
HELP = getattr(click.exceptions, "NoArgsIsHelpError", ())


@contextmanager
def _escape_click_errors() -> Iterator[None]:
    """Make the messages of click's errors printable, as they repeat what the user typed."""
    try:
        yield
    except HELP:
        raise
    except click.ClickException as error:
        attributes = vars(error)  # click calls them final
        for name in ("message", "ui_filename"):
            if name in attributes:
                attributes[name] = escape_unprintable(attributes[name])
        raise


def scene_options(required: bool = True) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that adds SCENE, --set, --swap, --seed and --duration to a command."""

    def add(command: Callable[..., None]) -> Callable[..., None]:
        for option in (
            traceback_option,
            click.option("--duration", metavar="S", help="Length of the run in seconds."),
            seed_option,
            swap_option,
            set_option,
            click.argument(
                "scene", metavar="SCENE", required=required, shell_complete=word_completer("scenes")
            ),
        ):
            command = option(command)
        return command

    return add


def word_completer(what: str) -> Callable[[click.Context, click.Parameter, str], list[Any]]:
    """Return a shell completion function that calls `what` of `dsa_des.commands.completion`."""

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
        from dsa_des.commands import completion

        items: list[Any] = getattr(completion, what)(ctx, incomplete)
        return items

    return complete


def _store_traceback_option(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    ctx.meta[_TRACEBACK] = value


_TRACEBACK = "dsa_des.traceback"
traceback_option = click.option(
    "--traceback",
    is_flag=True,
    expose_value=False,
    callback=_store_traceback_option,
    help="Where a block fails, show the calls that led there.",
)
seed_option = click.option("--seed", type=int, metavar="N", help="Seed of all random draws.")
set_option = click.option(
    "--set",
    "sets",
    multiple=True,
    metavar="KEY=VALUE",
    help="Change one value, e.g. blocks.radar.scan_rate_hz=2.",
    shell_complete=word_completer("keys"),
)
swap_option = click.option(
    "--swap",
    "swaps",
    multiple=True,
    metavar="BLOCK=TYPE",
    help="Put another component into a block; name and wires stay.",
    shell_complete=word_completer("swaps"),
)


class WithSubcommands(click.Command):
    """A command whose first word may name a further command, with options of its own."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.commands: dict[str, click.Command] = {}

    def command(self, name: str) -> Callable[[Callable[..., None]], click.Command]:
        """Return a decorator that adds a further command."""

        def add(function: Callable[..., None]) -> click.Command:
            self.commands[name] = click.command(name)(function)
            return self.commands[name]

        return add

    def make_context(
        self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any
    ) -> click.Context:
        """Return the further command's click context if the first word names one, else ours."""
        if args and args[0] in self.commands:
            name = f"{info_name} {args[0]}"
            return self.commands[args[0]].make_context(name, args[1:], parent, **extra)
        return super().make_context(info_name, args, parent, **extra)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, and the further commands behind them."""
        super().format_options(ctx, formatter)
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, one.get_short_help_str(70)) for name, one in self.commands.items()]
            )


class PluginGroup(click.Group):
    """A command group whose registered commands are loaded when they are named or listed.

    Whatever it runs ends in one line: also when a signal interrupts it (exit code 130 for ctrl-C,
    143 for SIGTERM) and when its output cannot be written (1).
    """

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run a command and end the program."""
        with exit_plainly_on_signal(), exit_on_write_error():
            try:
                return super().main(*args, **kwargs)
            except UsageError as error:  # a registered command that cannot be imported
                say_lines(f"error: {error}", err=True)
                sys.exit(2)

    # click turns KeyboardInterrupt into exit code 1 outside of these two.
    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        """Read the command line."""
        with exit_plainly_on_signal(), _escape_click_errors():
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command that the command line names."""
        with exit_plainly_on_signal(), _escape_click_errors():
            return super().invoke(ctx)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return our own commands and the registered ones, sorted."""
        return sorted({*super().list_commands(ctx), *entry_points_of(COMMANDS)})

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return the command of this name: our own, else a registered one, else None."""
        own = super().get_command(ctx, cmd_name)
        if own is not None or cmd_name not in entry_points_of(COMMANDS):
            return own
        from dsa_des.block.shadowed_packages import load_unnamed_entry_point

        command: Any = load_unnamed_entry_point(entry_points_of(COMMANDS)[cmd_name])
        if not isinstance(command, click.Command):
            raise click.ClickException(
                f"the registered command {cmd_name!r} is not a click.Command"
            )
        return command
