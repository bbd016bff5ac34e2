"""What a scene gives to note before it runs, and the plug-ins that report on a run."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from dsa_des.block.component import RunEnd
from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.shadowed_packages import load_unnamed_entry_point
from dsa_des.record.run_folder import REPORTS
from dsa_des.record.sinks import Observer, call_or_note
from dsa_des.running.grain import blocks_held_back_from_windows
from dsa_des.running.simulation import Simulation
from dsa_des.scene.graph import loop_number_by_block
from dsa_des.scene.scene import Scene
from dsa_des.terminal.terminal import say
from dsa_des.text.safe_text import shorten
from dsa_des.time.clock import MOST_JITTER

if TYPE_CHECKING:
    from dsa_des.running.simulation import Simulation


MOST_NOTES = 20
_LONGEST = 500


def notes_of_scene(simulation: Simulation) -> list[str]:
    """Return the notes on a scene that is set up, without those that its blocks acknowledge.

    First what was done to it that its files do not show, then keys that change nothing, then what
    its blocks and their times have to say of their own values.
    """
    scene = simulation.scene
    notes = notes_of_loading(scene)
    for name, section in scene.sections.items():
        notes += [f"{name}: {text}" for text in section.ineffective_key_notes()]
    for name, component in simulation.components.items():
        notes += [f"blocks.{name}: {text}" for text in component.p.ineffective_key_notes()]
        for text in call_or_note(f"blocks.{name}: warnings", notes, component.warnings) or ():
            notes.append(f"blocks.{name}: {shorten(str(text), _LONGEST)}")
        notes += [
            f"blocks.{name}: {text}" for text in _notes_of_ineffective_times(simulation, name)
        ]
    notes += _notes_of_useless_blocks(simulation)
    for text in _notes_after_changes(simulation, notes):
        notes.append(text)
    return _drop_acknowledged(scene, [*notes, *_notes_of_slowing_blocks(simulation)])


def _notes_after_changes(simulation: Simulation, said: list[str]) -> Iterator[str]:
    """Yield notes on blocks that apply only after a timed change."""
    scene = simulation.scene
    for number, stretch in enumerate(scene.stretches, start=1):
        before = simulation.stretches[number - 1]
        for name, component in simulation.stretches[number].items():
            if component is before[name]:
                continue
            notes: list[str] = []
            texts = list(component.p.ineffective_key_notes())
            texts += call_or_note(f"blocks.{name}: warnings", notes, component.warnings) or ()
            new = [text for text in texts if f"blocks.{name}: {text}" not in said]
            for text in (*notes, *new):
                begins_s = f"from {float(stretch.from_s):g} s"
                yield f"blocks.{name}: {begins_s}: {shorten(str(text), _LONGEST)}"
    for name, number in sorted(simulation.unheard.items()):
        yield (
            f"blocks.{name}: goes on by what its neighbours said at the start, though from "
            f"{float(scene.stretches[number - 1].from_s):g} s they say otherwise: "
            f"{scene.classes[name].import_path()} does not say what it remembers"
        )


def _notes_of_useless_blocks(simulation: Simulation) -> Iterator[str]:
    """Yield notes on blocks that repeat another's work or send what nobody receives or records."""
    scene, graph = simulation.scene, simulation.scene.graph
    first: list[str] = []
    for name, component in simulation.components.items():
        sources = [*graph.predecessors(name)]
        if component.outputs and not graph.out_degree(name):
            ends = any(issubclass(output.message, RunEnd) for output in component.outputs.values())
            if not ends and not any(message.recorded for message in component.records()):
                yield f"blocks.{name}: what it sends goes nowhere: no wire begins at it"
        elif sources and all(simulation.components[of].platforms() for of in sources):
            mine = scene.blocks[name]
            for of in first:
                other, on = scene.blocks[of], component.context.platform
                if (mine.cls, mine.parameters) == (other.cls, other.parameters) and (
                    on == simulation.components[of].context.platform
                    and sources == [*graph.predecessors(of)]
                ):
                    yield (
                        f"blocks.{name}: is as {of}, and both are on {on!r}: platform = NAME puts "
                        "it, and what it feeds, on another aircraft"
                    )
                    break
            first.append(name)


def _notes_of_ineffective_times(simulation: Simulation, name: str) -> Iterator[str]:
    """Yield notes on offsets, jitter, latencies without effect in this run or not fully obeyed."""
    scene, ends_s = simulation.scene, simulation.duration_s
    component = simulation.components[name]
    spec = component.clock_of(component.p)
    if spec is not None and spec.offset_s >= ends_s:
        yield f"offset_s is {float(spec.offset_s):g}: it never scans in {float(ends_s):g} s"
    if spec is not None and spec.jitter_s > MOST_JITTER / 3 * spec.period_s:
        yield (
            f"jitter_s is {spec.jitter_s:g}: scans keep within {MOST_JITTER:g} of the time between "
            f"them, {float(MOST_JITTER * spec.period_s):g} s, so that their order stays"
        )
    latency_s = scene.blocks[name].options.latency_s
    if latency_s >= ends_s:
        yield f"latency_s is {float(latency_s):g}: nothing it sends arrives in {float(ends_s):g} s"


def _notes_of_slowing_blocks(simulation: Simulation) -> list[str]:
    """Return notes on blocks that make others run scan by scan, in a loop or downstream."""
    scene = simulation.scene
    looped = sorted(loop_number_by_block(scene.graph))
    windowed = [name for name, node in simulation.nodes.items() if node.windowed]
    kept = blocks_held_back_from_windows(scene, windowed)
    # A window of a loop holds all blocks, so one outside of the loop counts as well.
    what = f"the feedback loop of {', '.join(looped)} runs" if looped else (
        f"{', '.join(kept)} run"
    )  # fmt: skip
    return [
        f"blocks.{name}: {scene.classes[name].import_path()} {why}: because of it {what} scan by "
        f"scan, "
        "which is slow"
        for name, why in simulation.slow.items()
    ]


def notes_of_loading(scene: Scene) -> list[str]:
    """Return notes on how loading changed a scene, such as parameters that a swap dropped."""
    dropped: dict[str, list[str]] = {}
    for key in scene.dropped:
        block, _, parameter = key.rpartition(".")
        dropped.setdefault(block, []).append(parameter)
    swapped = [f"{block}: the swap dropped {', '.join(keys)}" for block, keys in dropped.items()]
    return _drop_acknowledged(scene, [*swapped, *scene.notes])


def _drop_acknowledged(scene: Scene, notes: list[str]) -> list[str]:
    """Return notes without those that the blocks they are about acknowledge."""
    known = {f"blocks.{name}": block.options.acknowledged for name, block in scene.blocks.items()}
    return [
        text
        for text in notes
        if not any(
            _note_begins_with(text, head, begin) for head, said in known.items() for begin in said
        )
    ]


def _note_begins_with(note: str, head: str, begin: str) -> bool:
    """Return whether a note on `head` begins with `begin`, or has it after a colon."""
    if not begin or not note.startswith((f"{head}: ", f"{head}.")):
        return False
    rest = note[len(head) :].lstrip(":. ")
    return rest.startswith(begin) or f": {begin}" in rest


def print_notes(notes: Sequence[str]) -> None:
    """Print notes on standard error."""
    for text in notes[:MOST_NOTES]:
        say(f"note: {text}", err=True)
    if len(notes) > MOST_NOTES:
        say(f"note: and {len(notes) - MOST_NOTES} more", err=True)


# Half a minute of the processor, for most scenes.
_MANY_SCANS = 1e7


def warn_of_long_run(simulation: Simulation) -> None:
    """Print a note on standard error if a run has very many scans."""
    if simulation.scans > _MANY_SCANS:
        message = f"note: {float(simulation.duration_s):.4g} s of this scene are about "
        say(f"{message}{simulation.scans:.2g} scans", err=True)


@dataclass(frozen=True)
class Change:
    """How tables show one number of what `Report.compare` returns: heading, key and format.

    Parameters
    ----------
    heading : str
        Of its column, with the unit.
    key : str
        In what `Report.compare` returns.
    form : str
        Format specification, such as ``+.2f``.
    """

    heading: str
    key: str
    form: str


@dataclass(frozen=True)
class Difference:
    """How much two runs differ, as one number.

    Parameters
    ----------
    name : str
        What is counted, for tables: ``detections that differ``.
    label : str
        The same for the axis of a figure.
    share : callable
        From what `Report.compare` returned to a share, 0 where the runs are alike.
    """

    name: str
    label: str
    share: Callable[[Mapping[str, Any]], float]


class Report(Protocol):
    """Interface of a report plug-in, which summarises, compares and draws runs."""

    #: Numbers of `compare` that are worth a column, the most telling one first.
    changes: Sequence[Change]
    #: What is weighed against the cost of whole scenes.
    difference: Difference

    def observers(self, simulation: "Simulation") -> list[Observer]:
        """Return the observers that summarise this run's rows while they are recorded."""

    def show(self, console: Any, summary: dict[str, Any]) -> None:
        """Print the summary on a ``rich.console.Console`` that reads no markup."""

    def compare(self, reference: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
        """Return the differences between the recorded tables of two runs, by name."""

    def describe_changes(self, changes: Mapping[str, Any]) -> list[str]:
        """Return sentences on what `compare` found that words say better than numbers."""

    def draw(self, simulation: "Simulation", folder: Path, summary: dict[str, Any]) -> list[Path]:
        """Draw figures from Parquet tables in `folder`, write them there and return the paths.

        The run is complete when this is called, and may be large: tables are read in pieces.
        """


def load_reports() -> list[Report]:
    """Return one instance of every registered report, in the order of their names."""
    return [load_unnamed_entry_point(point)() for point in entry_points_of(REPORTS).values()]


def draw_all_reports(
    reports: Iterable[Report], simulation: "Simulation", folder: Path, summary: dict[str, Any]
) -> list[str]:
    """Let every report draw figures of a finished run; return a note on each that failed.

    A figure that fails takes nothing with it: the run is complete without.

    Raises OSError if one cannot be written.
    """
    notes: list[str] = []
    for report in reports:
        call_or_note("drawing", notes, report.draw, simulation, folder, summary, unless=OSError)
    return notes
