"""The command line: ``dsa-des run``, ``check``, ``graph``, ``explain``, ``cost``, ``components``.

This file declares commands and nothing else; it imports click only, so that ``--help`` is instant.
Exit codes: 0 done, 1 a block failed while it ran or results could not be written, 2 the scene or
the call is wrong, 130 ctrl-C, 143 SIGTERM.
"""

from typing import Any

import click

from dsa_des import __version__
from dsa_des.commands.group import (
    PluginGroup,
    WithSubcommands,
    plain_errors,
    scene_options,
    seed_option,
    set_option,
    swap_option,
    word_completer,
)

_figures_option = click.option(
    "--no-figures", is_flag=True, help="Draw nothing; results are the same."
)
_everything_option = click.option(
    "--simulate-everything",
    is_flag=True,
    help="Build also the effects the scene does not call for; results must not change.",
)


@click.group(
    cls=PluginGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(__version__, prog_name="dsa-des")
def main() -> None:
    """Simulate a UAV's detect-and-avoid chain: which sensor sees what, when, how far away."""


@main.command()
@scene_options()
@click.option("--out", metavar="DIR", help="Folder for the results [default: runs/SCENE-NNN].")
@click.option("--quiet", is_flag=True, help="Print nothing.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON only.")
@_figures_option
@_everything_option
@click.option(
    "--realtime",
    metavar="FACTOR",
    help="Pace the run: FACTOR simulated seconds per second; results do not change.",
)
@plain_errors
def run(**options: Any) -> None:
    """Run SCENE and say which sensor saw which intruder, when, and how far away."""
    from dsa_des.commands.scene import run_scene

    run_scene(**options)


@main.command()
@scene_options()
@click.option(
    "--no-import",
    is_flag=True,
    help="Import no module that SCENE names (module:Class, other packages' types); check the rest.",
)
@plain_errors
def check(**options: Any) -> None:
    """Check SCENE without running it; report everything that is wrong at once."""
    from dsa_des.commands.scene import check_scene_file

    check_scene_file(**options)


@main.command()
@scene_options()
@click.option("--dot", is_flag=True, help="Print the graph in Graphviz's DOT language.")
@click.option("--png", is_flag=True, help="Draw the graph as SCENE-graph.png.")
@click.option("--out", metavar="FILE", help="Another name for the PNG file.")
@plain_errors
def graph(**options: Any) -> None:
    """Show the blocks and wires of SCENE, in the order in which they run."""
    from dsa_des.commands.graph import show_graph

    show_graph(**options)


@main.command()
@scene_options()
@click.option("--measure", is_flag=True, help="Run the scene and show each effect's share.")
@_everything_option
@plain_errors
def explain(**options: Any) -> None:
    """Say which effects SCENE calls for, which it does not, and because of what."""
    from dsa_des.commands.scene import print_effects_of_scene

    print_effects_of_scene(**options)


_resume_option = click.option(
    "--resume", is_flag=True, help="Run only what is missing of an earlier attempt."
)
_workers_option = click.option(
    "--workers", type=int, metavar="N", help="Processes [default: one per processor]."
)


@main.command()
@scene_options(required=False)
@click.option(
    "--answer",
    "answers",
    multiple=True,
    metavar="RESULT",
    help="Of a study: by how much each model changes a result, on the same runs.",
)
@click.option(
    "--vary",
    "listed",
    multiple=True,
    metavar="KEY=VALUES",
    help="With --answer, besides the ladders: swap.tracker=tracking.imm, "
    "blocks.radar.scan_rate_hz=[1, 2].",
)
@_workers_option
@click.option("--block", metavar="NAME", help="Climb only this block's ladders.")
@click.option("--against", metavar="RUNG", help="Another reference than the ladder's own.")
@click.option(
    "--repeats",
    type=click.IntRange(min=1),
    metavar="N",
    help="How often each rung is timed, the best of ten passes each [default: 10]; with --answer "
    "in how many turns the runs are made.",
)
@click.option(
    "--budget",
    "budgets",
    multiple=True,
    metavar="ERROR",
    help="Largest error allowed, with its unit: 0.5mrad, 2m, 0.01Pd, 1m²; with --answer the "
    "largest change: 300m, 0.02, 5% [default: 10%].",
)
@click.option(
    "--all",
    "whole_chain",
    is_flag=True,
    help="Combine the rungs of all blocks and draw the front of the whole chain.",
)
@click.option(
    "--map",
    "map_name",
    metavar="LADDER",
    help="Draw maps of the rungs' errors: geometry; needs no SCENE.",
)
@click.option("--out", metavar="DIR", help="Folder for the results [default: runs/SCENE-cost-NNN].")
@_resume_option
@_figures_option
@click.option("--json", "as_json", is_flag=True, help="Print the rows as JSON only.")
@plain_errors
def cost(answers: tuple[str, ...], listed: tuple[str, ...], **options: Any) -> None:
    """Run SCENE with each model of its blocks in turn: what accuracy costs, and what it buys.

    With --answer SCENE is a STUDY, and it is said by how much each model changes its results.
    """
    if answers:
        from dsa_des.commands.cost_answer import run_study_with_each_model

        run_study_with_each_model(answers=answers, listed=listed, **options)
        return
    from dsa_des.commands.cost import measure_cost_of_accuracy

    measure_cost_of_accuracy(listed=listed, **options)


@main.command()
@click.argument("name", required=False, shell_complete=word_completer("types"))
@click.argument("key", required=False, shell_complete=word_completer("keys_of_type"))
@plain_errors
def components(name: str | None, key: str | None) -> None:
    """List the block types or those of a kind (radar), or describe a type or one KEY of it."""
    from dsa_des.commands.catalogue import show_components

    show_components(name, key)


@main.command()
@click.option("--copy", metavar="DIR", help="Copy them and all that they extend into DIR.")
@plain_errors
def examples(copy: str | None) -> None:
    """List the shipped scenes and studies: their names stand for their files everywhere."""
    from dsa_des.commands.catalogue import list_or_copy_examples

    list_or_copy_examples(copy)


_out_option = click.option(
    "--out", metavar="DIR", help="Folder for the results [default: studies/STUDY-NNN]."
)
_replicas_option = click.option(
    "--replicas",
    type=int,
    metavar="N",
    help="Runs of each cell of a study; of each scene [default: 20].",
)
_json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print the tables as JSON only."
)
_measure_option = click.option(
    "--measure",
    is_flag=True,
    help="Measure how wrong the models of the first run are, for the report: a run for each model.",
)


@click.command(cls=WithSubcommands)
@click.argument("study", metavar="STUDY", required=False, shell_complete=word_completer("studies"))
@set_option
@swap_option
@seed_option
@_replicas_option
@_workers_option
@_resume_option
@click.option("--executor", type=click.Choice(["local", "dask"]), default="local")
@click.option("--scheduler", metavar="ADDR", help="Dask scheduler, e.g. tcp://localhost:8786.")
@_out_option
@click.option("--metrics", is_flag=True, help="List what studies can measure.")
@_figures_option
@_measure_option
@_json_option
@click.option("--quiet", is_flag=True, help="Print nothing.")
@plain_errors
def study(**options: Any) -> None:
    """Run a STUDY: many runs of a scene over axes and random draws, with their statistics.

    --set changes a value of the study file: replicas=4, or set.blocks.radar.scan_rate_hz=2 for one
    of its scene; --swap puts another component into a block of its scene.
    """
    from dsa_des.commands.study import study_command

    study_command(**options)


main.add_command(study)


@study.command("show")
@click.argument("folder", metavar="FOLDER", type=click.Path())
@_figures_option
@_json_option
@plain_errors
def show(**options: Any) -> None:
    """Print the tables of a study's folder, and draw its figures again."""
    from dsa_des.commands.study import show_command

    show_command(**options)


@study.command("report")
@click.argument("folder", metavar="FOLDER", type=click.Path())
@click.option("--out", metavar="FILE", help="Another name for the page.")
@_figures_option
@_measure_option
@plain_errors
def report(**options: Any) -> None:
    """Write the tables and figures of a study's folder as one self-contained HTML page."""
    from dsa_des.commands.study import report_command

    report_command(**options)


@main.command()
@click.argument(
    "paths", nargs=-1, required=True, metavar="A [B ...]", shell_complete=word_completer("examples")
)
@set_option
@swap_option
@seed_option
@_replicas_option
@click.option("--metric", "results", multiple=True, metavar="NAME", help="Show these results only.")
@_workers_option
@click.option("--out", metavar="DIR", help="Folder for the results [default: studies/compare-NNN].")
@plain_errors
def compare(**options: Any) -> None:
    """Compare studies, scenes or a swap: paired differences on the same encounters and draws.

    --set and --seed are of all that is compared; --swap compares A with itself after the swap.
    """
    from dsa_des.commands.compare import compare_command

    compare_command(**options)


@main.command()
@click.argument("case", metavar="CASE", shell_complete=word_completer("cases"))
@click.option("--out", metavar="PACK", help="Folder of the pack [default: packs/CASE-NNN].")
@set_option
@click.option(
    "--encounters", type=int, metavar="N", help="Of the system and what stands beside it."
)
@_workers_option
@_resume_option
@plain_errors
def evidence(**options: Any) -> None:
    """Run a CASE from requirement to verdict: a folder that a stranger can run again.

    --set changes a value of the case's file: requirements[0].most=0.2, or, for one of the system's
    scene, set.blocks.radar.range_km=5. Exit code 1 where no verdict can be given.
    """
    from dsa_des.commands.evidence import evidence_command

    evidence_command(**options)


if __name__ == "__main__":
    main()
