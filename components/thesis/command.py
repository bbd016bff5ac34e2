"""The command ``dsa-des reproduce``; it imports click only, so that ``--help`` stays instant."""

from typing import Any

import click

from dsa_des.commands.group import plain_errors


@click.command()
@click.argument("items", metavar="[ITEM]...", nargs=-1)
@click.option("--out", metavar="DIR", help="Folder for the results [default: runs/thesis-NNN].")
@click.option("--json", "as_json", is_flag=True, help="Print the rows as JSON only.")
@click.option(
    "--page",
    metavar="FILE",
    help="Also write the page about all items, its figures in images/ beside it.",
)
@plain_errors
def reproduce(**options: Any) -> None:
    """Make the thesis's figures and tables: what it prints, what we get, and why they differ.

    ITEM is, for example, fig-4.14 or table-4.4; all of them if none is named.
    """
    from components.thesis.reproduce import reproduce_items

    reproduce_items(**options)
