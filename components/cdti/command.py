"""The command ``dsa-des cdti``; it imports click only, so that ``--help`` stays instant."""

from typing import Any

import click

from dsa_des.commands.group import plain_errors, scene_options


@click.command()
@scene_options()
@click.option(
    "--realtime",
    metavar="FACTOR",
    default="1",
    show_default=True,
    help="Simulated seconds per second of the clock.",
)
@click.option("--out", metavar="DIR", help="Folder for the results [default: runs/SCENE-NNN].")
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address of this machine that the display is served at.",
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    show_default=True,
    help="Its port; 0 takes a free one.",
)
@click.option(
    "--units",
    type=click.Choice(["nautical", "metric"]),
    default="nautical",
    show_default=True,
    help="What the display begins with: nmi, ft and kt, or km, m and m/s.",
)
@click.option(
    "--platform",
    metavar="NAME",
    help="Whose display [default: what carries the operator's console, or the ownship].",
)
@click.option("--no-wait", is_flag=True, help="Begin before an operator is there and ready.")
@click.option("--no-figures", is_flag=True, help="Draw nothing; results are the same.")
@plain_errors
def cdti(**options: Any) -> None:
    """Run SCENE in real time, with the traffic display of its operator in a browser.

    The address that is printed lets one browser decide, once; whoever opens it later watches. The
    run folder holds what was decided, and its scene.toml replays it without a person. Ctrl-C ends
    the run, and keeps it.
    """
    from components.cdti.session import run_session

    run_session(**options)
