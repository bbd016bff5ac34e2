"""The command ``dsa-des encounters``; it imports click only, so that ``--help`` stays instant."""

from typing import Any

import click

from dsa_des.commands.group import plain_errors


@click.group()
def encounters() -> None:
    """Encounters of an airspace: sample models, make sets, weigh risk."""


@encounters.command()
@click.argument("table", metavar="TABLE")
@click.option("--nominal", required=True, metavar="COLUMN", help="Event without avoidance, 0 or 1.")
@click.option("--mitigated", required=True, metavar="COLUMN", help="Event with avoidance, 0 or 1.")
@click.option("--weight", metavar="COLUMN", help="Weight of each encounter [default: all 1].")
@click.option(
    "--cluster", metavar="COLUMN", help="Rows with the same value hang together [default: none]."
)
@click.option(
    "--by", metavar="COLUMN[,...]", help="Also a ratio for each class that these columns name."
)
@click.option(
    "--edges",
    metavar="A,B,...",
    help="Edges of the classes, where the column of --by holds numbers.",
)
@click.option(
    "--confidence",
    type=click.FloatRange(0.5, 1.0, min_open=True, max_open=True),
    default=0.95,
    show_default=True,
)
@click.option(
    "--interval",
    "method",
    type=click.Choice(["gamma", "delta", "bootstrap"]),
    default="gamma",
    show_default=True,
    help="By gamma distributions, for few events and uneven weights too; paired delta method on "
    "the logarithm; or resampled encounters.",
)
@click.option("--resamples", type=click.IntRange(100, 1_000_000), default=4000, show_default=True)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the bootstrap.")
@click.option(
    "--skip-damaged", is_flag=True, help="Leave damaged rows out and count them; else an error."
)
@click.option("--json", "as_json", is_flag=True, help="Print all numbers as JSON only.")
@plain_errors
def risk(**options: Any) -> None:
    """Risk ratio of a TABLE with one row per encounter, run without and with avoidance.

    TABLE is a .csv or .parquet file, or the folder of a study.
    """
    from components.encounters.encounter_tables import show_risk

    show_risk(**options)


@encounters.command()
@click.option("--model", required=True, metavar="FILE", help="Text file of an encounter model.")
@click.option("--count", required=True, type=click.IntRange(1, 100_000_000), help="Tracks.")
@click.option(
    "--first",
    type=click.IntRange(0, 2**53),
    default=0,
    show_default=True,
    help="Number of the first track; a track is the same whichever others are made.",
)
@click.option(
    "--duration-s",
    required=True,
    type=click.FloatRange(0, 86_400),
    metavar="T",
    help="Length of each; rows at 0, 1, ... up to T seconds.",
)
@click.option("--seed", type=int, default=0, show_default=True)
@click.option(
    "--raw", is_flag=True, help="What the network gives: nothing is rejected, nothing flown."
)
@click.option(
    "--dynamics",
    type=click.Choice(["euler", "point_mass"]),
    default="euler",
    show_default=True,
    help="Steps of 1 s, or a point mass with limits at 0.1 s; without --raw.",
)
@click.option("--out", required=True, metavar="TRACKS.csv", help="The table.")
@plain_errors
def sample(**options: Any) -> None:
    """Tracks of one aircraft each, sampled from an encounter model."""
    from components.encounters.model_commands import sample_tracks

    sample_tracks(**options)


@encounters.command()
@click.option(
    "--made", metavar="FILE.toml", help="Encounters made by hand, as a table describes them."
)
@click.option(
    "--tracks", metavar="FOLDER", help="Recorded flights, of which two at a time are paired."
)
@click.option("--model", metavar="FILE", help="Encounter model of the ownship.")
@click.option("--intruder-model", metavar="FILE", help="That of the intruder [default: the same].")
@click.option("--count", type=click.IntRange(1, 100_000_000), help="How many, of models or tracks.")
@click.option(
    "--first",
    type=click.IntRange(0, 2**53),
    default=0,
    show_default=True,
    help="Number of the first; an encounter is the same whichever others are made.",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option(
    "--at",
    nargs=2,
    type=float,
    default=(0.0, 0.0),
    metavar="LAT LON",
    help="Where the ownship is at the closest approach, deg [default: 0 0].",
)
@click.option(
    "--horizontal",
    nargs=2,
    metavar="EDGES SHARES",
    help="How often which signed horizontal miss distances (ft) are drawn: -6000,0,6000 1,1. "
    "Weights undo it; none lies outside the edges [default: to 3 nmi, more within 500 ft].",
)
@click.option(
    "--vertical",
    nargs=2,
    metavar="EDGES CHANCES",
    help="With what chance which vertical miss distances (ft) are accepted: -300,300 1 [default: "
    "to 1500 ft, more within 100 ft].",
)
@click.option("--out", required=True, metavar="SET.parquet", help="The set.")
@plain_errors
def generate(**options: Any) -> None:
    """Make a set of weighted encounters from encounter models, from real tracks, or by hand."""
    from components.encounters.model_commands import generate_set

    generate_set(**options)


@encounters.command()
@click.argument("files", metavar="FILE...", nargs=-1, required=True)
@click.option(
    "--weights", metavar="TABLE.csv", help="Weights: columns encounter and weight [default: 1]."
)
@click.option(
    "--at", nargs=2, type=float, metavar="LAT LON", help="Where the origin is put [default: 0 0]."
)
@click.option("--skip-damaged", is_flag=True, help="Leave damaged encounters out and count them.")
@click.option("--out", required=True, metavar="FILE", help="SET.parquet, or waypoints: FILE.bin.")
@plain_errors
def convert(**options: Any) -> None:
    """Turn encounters of public formats into a set, or a set into waypoints.

    FILE is a set (.parquet), a file of waypoints (.bin, .dat), or tracks (.txt, .csv, .mat, or any
    file of recorded aircraft), one encounter each; files of one aircraft are taken two by two, the
    ownship's first.
    """
    from components.encounters.set_commands import convert_sets

    convert_sets(**options)


@encounters.command()
@click.argument("files", metavar="FILE...", nargs=-1, required=True)
@click.option(
    "--most",
    type=click.IntRange(1, 1_000_000),
    default=2000,
    show_default=True,
    help="Of so many encounters, evenly spread, the closest approach is looked for.",
)
@click.option("--figure", metavar="FILE.png", help="Histograms and a plan of a sample.")
@click.option("--skip-damaged", is_flag=True, help="Leave damaged encounters out and count them.")
@plain_errors
def show(**options: Any) -> None:
    """Print a set's weights, and the geometry at its closest approaches.

    FILE is a set, or whatever `convert` reads.
    """
    from components.encounters.set_commands import print_set_statistics

    print_set_statistics(**options)


@encounters.command()
@click.argument("file", metavar="SET.parquet")
@click.option(
    "--levels",
    required=True,
    metavar="A,B,...",
    help="Falling scores: below A is the first stage, below B the second, ...",
)
@click.option(
    "--copies",
    required=True,
    metavar="N,N,...",
    help="How many copies are expected outside of all stages, in the first, ... Weights undo it.",
)
@click.option(
    "--scores", metavar="TABLE", help="Table or folder of a study with the column encounter."
)
@click.option(
    "--score",
    metavar="COLUMN",
    help="Its column; less is nearer to the event [default: the least distance of the flights, in "
    "sizes of the NMAC cylinder].",
)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--out", required=True, metavar="SET.parquet", help="The set of copies.")
@plain_errors
def split(**options: Any) -> None:
    """Make a set in which encounters that matter stand more often, with weights that undo it."""
    from components.encounters.set_commands import split_encounters

    split_encounters(**options)
