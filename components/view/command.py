"""The command ``dsa-des view``; it imports click only, so that ``--help`` stays instant."""

from typing import Any

import click

from dsa_des.commands.group import plain_errors


@click.command()
@click.argument("run", metavar="RUN")
@click.option("--out", metavar="FILE.html", help="The page [default: beside RUN, with its name].")
@plain_errors
def view(**options: Any) -> None:
    """Make a page that replays RUN: plan, altitudes, scans, detections, tracks, alerts.

    RUN is a run's folder or a .daa file. The page holds all its data and asks for nothing else; it
    opens from disk.
    """
    from components.view.run_picture import make_view

    make_view(**options)
