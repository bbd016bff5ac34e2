"""The command ``dsa-des view``; it imports click only, so that ``--help`` stays instant."""

from typing import Any

import click

from dsa_des.commands.group import plain_errors


@click.command()
@click.argument("runs", metavar="RUN...", nargs=-1, required=True)
@click.option(
    "--out", metavar="FILE.html", help="The page [default: beside the first RUN, named as all are]."
)
@click.option("--platform", metavar="NAME", help="Show what one of several platforms has.")
@plain_errors
def view(**options: Any) -> None:
    """Make a page that replays RUN: plan, altitudes, scans, detections, tracks, alerts.

    RUN is a run's folder or a .daa file; two or three stand beside each other on one clock. The
    page holds all its data and asks for nothing else; it opens from disk.
    """
    from components.view.make_view import write_view_page

    write_view_page(**options)
