"""The command ``dsa-des alert``; it imports click only, so that ``--help`` stays instant."""

from typing import Any

import click

from dsa_des.commands.group import plain_errors


@click.command()
@click.argument("encounters", metavar="FILE...", nargs=-1, required=True)
@click.option("--conf", required=True, metavar="FILE.conf", help="Alerters, times and memory.")
@click.option(
    "--out",
    required=True,
    metavar="ALERTS.csv",
    help="The table; of several encounters a folder, one table each.",
)
@click.option("--no-hysteresis", is_flag=True, help="No memory: every row stands by itself.")
@click.option(
    "--figure",
    metavar="FILE.png",
    help="Also draw levels, times and flights; of several encounters a folder.",
)
@click.option(
    "--bands",
    metavar="BANDS.csv",
    help="Also write the bands of guidance; of several encounters a folder.",
)
@click.option(
    "--wind",
    type=(float, float),
    metavar="DEG KNOT",
    help="Where the wind blows to, and how fast; by default from the ownship's columns "
    "heading and airspeed, else none.",
)
@click.option(
    "--ownship", metavar="NAME", help="Name, address or callsign [default: the first aircraft]."
)
@click.option(
    "--own-file", metavar="FILE", help="Another file, with the flight of the ownship at that time."
)
@click.option(
    "--decimals",
    default=6,
    show_default=True,
    type=click.IntRange(0, 15),
    help="Decimals of the numbers in the table.",
)
@plain_errors
def alert(**options: Any) -> None:
    """Alert levels of recorded encounters, by a configuration of DAIDALUS.

    FILE is a file of recorded aircraft of any kind that traffic.file reads: .daa and .xyz, tables,
    receivers' logs, tracks and more; or a folder of .daa and .xyz files.
    """
    from components.alerting.alert_files import write_alert_files

    write_alert_files(**options)
