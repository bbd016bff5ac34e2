"""The command ``dsa-des export-fmu``; it imports click only, so that ``--help`` stays instant."""

from typing import Any

import click

from dsa_des.commands.group import plain_errors


@click.command("export-fmu")
@click.argument("scene", metavar="SCENE")
@click.option("--out", required=True, metavar="FILE.fmu", help="The FMU to write.")
@click.option("--set", "sets", multiple=True, metavar="KEY=VALUE", help="Override a scene value.")
@click.option("--swap", "swaps", multiple=True, metavar="BLOCK=TYPE", help="Use another type.")
@click.option("--seed", type=int, help="Override the scene's seed.")
@plain_errors
def export_fmu(**options: Any) -> None:
    """Write a scene's chain as an FMU (FMI 3, co-simulation).

    Its inputs are where the ownship and the scene's aircraft are; its outputs, at the end of a
    step, are what was detected at its start. It runs where dsa_des is installed for Python.
    """
    from components.foreign.fmu.export import write_chain_fmu

    write_chain_fmu(**options)
