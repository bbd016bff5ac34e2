"""The command line: ``dsa-des run``, ``check``, ``graph``, ``components``.

This file declares commands and nothing else; it imports click only, so that ``--help`` is instant.
Exit codes: 0 done, 1 a block failed while it ran, 2 the scene or the call is wrong.
"""

from collections.abc import Callable
from typing import Any

import click

from dsa_des import __version__
from dsa_des.command_plugins import PluginGroup
from dsa_des.plain_errors import plain_errors


def _scene_options(command: Callable[..., None]) -> Callable[..., None]:
    for option in (
        click.option("--duration", metavar="S", help="Length of the run in seconds."),
        click.option("--seed", type=int, help="Seed of all random draws."),
        click.option(
            "--swap",
            "swaps",
            multiple=True,
            metavar="BLOCK=TYPE",
            help="Put another component into a block; name and wires stay.",
        ),
        click.option(
            "--set",
            "sets",
            multiple=True,
            metavar="KEY=VALUE",
            help="Change one value, e.g. blocks.radar.scan_rate_hz=2.",
        ),
        click.argument("scene", metavar="SCENE"),
    ):
        command = option(command)
    return command


_everything_option = click.option(
    "--simulate-everything",
    is_flag=True,
    help="Build also the effects the scene does not call for; results must not change.",
)


@click.group(
    cls=PluginGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(__version__, prog_name="dsa-des")
def main() -> None:
    """Simulate a UAV's detect-and-sense chain: who saw the intruder, when, and how far away."""


@main.command()
@_scene_options
@click.option("--out", metavar="DIR", help="Folder for the results [default: runs/SCENE-NNN].")
@click.option("--quiet", is_flag=True, help="Print nothing.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON only.")
@_everything_option
@click.option(
    "--realtime",
    metavar="FACTOR",
    help="Pace the run: FACTOR simulated seconds per second; results do not change.",
)
@plain_errors
def run(**options: Any) -> None:
    """Run SCENE and say which sensor saw which intruder, when, and how far away."""
    from dsa_des.commands.run import run_scene

    run_scene(**options)


@main.command()
@_scene_options
@plain_errors
def check(**options: Any) -> None:
    """Check SCENE without running it; report everything that is wrong at once."""
    from dsa_des.commands.check import check_scene_file

    check_scene_file(**options)


@main.command()
@_scene_options
@click.option("--dot", is_flag=True, help="Print the graph in Graphviz's DOT language.")
@click.option("--png", is_flag=True, help="Draw the graph as SCENE-graph.png.")
@click.option("--out", metavar="FILE", help="Another name for the PNG file.")
@plain_errors
def graph(**options: Any) -> None:
    """Show the blocks and wires of SCENE, in the order in which they run."""
    from dsa_des.commands.graph import show_graph

    show_graph(**options)


@main.command()
@_scene_options
@click.option("--measure", is_flag=True, help="Run the scene and show each effect's share.")
@_everything_option
@plain_errors
def explain(**options: Any) -> None:
    """Say which effects SCENE calls for, which it does not, and because of what."""
    from dsa_des.commands.explain import explain_scene

    explain_scene(**options)


@main.command()
@click.argument("name", required=False)
@plain_errors
def components(name: str | None) -> None:
    """List the block types, or describe one: its ports, parameters, units and bounds."""
    from dsa_des.commands.components import show_components

    show_components(name)


if __name__ == "__main__":
    main()
