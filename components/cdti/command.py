"""The command ``dsa-des cdti``; it imports click only, so that ``--help`` stays instant."""

from typing import Any

import click

from dsa_des.commands.group import plain_errors


@click.command()
@click.argument("scene", metavar="SCENE")
@click.option("--set", "sets", multiple=True, metavar="KEY=VALUE", help="Override a scene value.")
@click.option("--swap", "swaps", multiple=True, metavar="BLOCK=TYPE", help="Use another type.")
@click.option("--seed", type=int, help="Override the scene's seed.")
@click.option("--duration", metavar="SECONDS", help="Override the scene's duration.")
@click.option(
    "--factor", default="1", show_default=True, help="Simulated seconds per second of the clock."
)
@click.option("--out", metavar="FOLDER", help="Where the run goes [default: runs/NAME].")
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
@click.option("--no-wait", is_flag=True, help="Begin before an operator is there and ready.")
@click.option("--figures", is_flag=True, help="Draw the run's figures when it has ended.")
@plain_errors
def cdti(**options: Any) -> None:
    """Run SCENE in real time, with the traffic display of its operator in a browser.

    The address that is printed lets one browser decide, once; whoever opens it later watches. The
    run folder holds what was decided, and its scene.toml replays it without a person. Ctrl-C ends
    the run, and keeps it.
    """
    from components.cdti.session import run_session

    run_session(**options)
