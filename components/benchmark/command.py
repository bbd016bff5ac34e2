"""The command ``dsa-des benchmark``; it imports click only, so that ``--help`` stays instant."""

from typing import Any

import click

from dsa_des.commands.group import plain_errors


@click.command()
@click.argument("scenes", nargs=-1)
@click.option("--quick", is_flag=True, help="Shorter scenes and fewer repetitions: a minute.")
@click.option("--repeats", type=click.IntRange(1, 99), help="Repetitions [default: 5].")
@click.option("--json", "json_file", metavar="FILE", help="Write the rows to FILE as JSON.")
@click.option(
    "--embed",
    is_flag=True,
    help="Time single calls of the embedding interface instead: 4 intruders, 3 sensors.",
)
@click.option("--compare", metavar="OLD.json", help="Show the change since an earlier FILE.")
@plain_errors
def benchmark(**options: Any) -> None:
    """Time the engine against a plain loop over the same physics, scene by scene."""
    from components.benchmark.run_benchmark import run_benchmark

    run_benchmark(**options)
