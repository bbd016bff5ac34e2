"""The command ``dsa-des export``; it imports click only, so that ``--help`` stays instant."""

from typing import Any

import click

from dsa_des.commands.group import plain_errors

FORMATS = ("csv", "kml", "czml", "daa", "xyz", "asterix", "mcap", "mat", "operator-csv")


@click.command()
@click.argument("run", metavar="RUN")
@click.option("--to", required=True, type=click.Choice(FORMATS), help="What to write.")
@click.option("--out", metavar="PATH", help="Where [default: beside RUN, with its name].")
@click.option(
    "--step-s", type=float, help="Time between rows of daa and xyz, 0 as recorded.  [default: 1]"
)
@click.option(
    "--geoid-m", type=float,
    help="Height of the geoid above the ellipsoid, for kml.  [default: that of the scene's "
    "terrain, else 0]",
)  # fmt: skip
@plain_errors
def export(**options: Any) -> None:
    """Write a run's folder in another format.

    csv is a folder with a file for each table; mat a MATLAB file with all of them; kml and czml
    flights, tracks, alerts and detections, for globes; daa and xyz the flights, as DAIDALUS reads
    them;
    asterix what radars, trackers and the ownship report; mcap all tables, flights and detections
    for viewers of robots' logs;
    operator-csv a row for each alert, with what the operator did about it and when.
    """
    from components.export.export_formats import export_run

    export_run(**options)
