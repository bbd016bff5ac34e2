"""Reading the ``wires`` of a scene: ``"gate -> radar"`` or a table with a delay.

A wire names blocks, and ports where a block has several that fit::

    wires = [
      "traffic -> transform -> gate",
      "gate.targets -> radar.targets",
      {from = "tracker.cue", to = "radar.cue", delay = "1 scan", holds = "nothing"},
    ]
"""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from typing import Any

from dsa_des.block.component import Component, to_scene_number
from dsa_des.errors import Problem, did_you_mean, nearest_name
from dsa_des.scene.block_table import BlockOptions
from dsa_des.scene.keys import Key
from dsa_des.scene.scene_file import SceneFile
from dsa_des.time.clock import parse_rational

_NAME = r"[A-Za-z_][\w-]*"
_END = re.compile(rf"{_NAME}(\.[A-Za-z_]\w*)?")
_SCANS = re.compile(r"([0-9]+) scans?")
_MOST_SCANS = 1_000_000
#: Options of a wire that may change while a run lasts.
MAY_CHANGE = ("delay_s", "jitter_s", "drop_probability")
_KEYS = ("from", "to", "delay_s", "delay", "jitter_s", "drop_probability", "holds")


@dataclass(frozen=True)
class Wire:
    """One connection between an output and an input."""

    #: Block and port names.
    source: str
    output: str
    target: str
    input: str
    #: Time on the wire; 0 for the same instant.
    delay_s: Fraction = Fraction(0)
    #: Delay counted in scans of the receiving block's clock (of the sender's when it has none).
    delay_scans: int = 0
    #: What the input holds before the first message; required of a feedback wire.
    holds: Any = None
    #: Largest extra delay; each message takes a uniformly drawn part of it.
    jitter_s: Fraction = Fraction(0)
    #: Share of the messages that are lost.
    drop_probability: float = 0.0
    #: Processing time of the sending block, given in its table.
    latency_s: Fraction = Fraction(0)
    #: Whether the sending block's messages go through a shared processor.
    queued: bool = False

    @property
    def is_delayed(self) -> bool:
        """Whether messages certainly arrive later than made, by a delay or a processor's queue."""
        return self.total_delay_s > 0 or self.delay_scans > 0 or self.queued

    @property
    def total_delay_s(self) -> Fraction:
        """Delay on the wire plus latency of the sending block, s."""
        # Studies ask this of every wire of every replica, and sums of fractions are slow.
        return self.delay_s + self.latency_s if self.latency_s else self.delay_s

    def __str__(self) -> str:
        return f"{self.source}.{self.output} -> {self.target}.{self.input}"

    def to_entry(self) -> dict[str, Any] | str:
        """Return the wire as an entry of ``wires``."""
        plain = Wire(self.source, self.output, self.target, self.input)
        if plain == replace(self, latency_s=plain.latency_s, queued=plain.queued):
            return str(self)
        table: dict[str, Any] = {
            "from": f"{self.source}.{self.output}",
            "to": f"{self.target}.{self.input}",
        }
        if self.delay_scans:
            table["delay"] = f"{self.delay_scans} scan{'s' if self.delay_scans > 1 else ''}"
        elif self.delay_s:
            table["delay_s"] = to_scene_number(self.delay_s)
        if self.jitter_s:
            table["jitter_s"] = to_scene_number(self.jitter_s)
        if self.drop_probability:
            table["drop_probability"] = self.drop_probability
        if self.holds is not None:
            table["holds"] = self.holds
        return table


def read_wires(
    scene: SceneFile,
    classes: Mapping[str, type[Component]],
    unsure: set[str],
) -> list[Wire]:
    """Return the wires of a scene, sorted; what is wrong with them is added to its problems.

    Wires of blocks whose class is None, not known, are not judged. `unsure` receives the blocks
    that a faulty wire meant to feed.
    """
    entries = scene.data.get("wires", [])
    if not isinstance(entries, list):
        scene.report(("wires",), "must be a list of wires", entries)
        unsure.update(classes)  # its targets are unknown
        return []
    wires: list[Wire] = []
    for position, entry in enumerate(entries):
        key: Key = ("wires", position)
        try:
            hops = _read_hops(entry)
        except _WireError as error:
            scene.report((*key, *error.key), str(error), *error.value)
            unsure.update(classes)  # its target is unknown
            continue
        of_wire: list[Problem] = []  # of this wire: one block may be missing at several of its hops
        for source, target, options in hops:
            try:
                wire = _wire_between_ends(source, target, options, classes)
            except _WireError as error:
                problem = scene.problem(key, str(error), *error.value)
                if problem not in of_wire:
                    of_wire.append(problem)
                wire = None
            if wire is not None:
                wires.append(wire)
            else:
                name = target.partition(".")[0]
                unsure.add(name if name in classes else nearest_name(name, classes) or name)
        scene.problems += of_wire
    _report_double_writers(scene, wires, classes)
    return sorted(wires, key=lambda w: (w.target, w.input, w.source, w.output))


def explain_bad_block_name(name: str) -> str | None:
    """Return why a name cannot be a block's name; None if it can."""
    if re.fullmatch(_NAME, name):
        return None
    return (
        "is no name of a block: names are letters, digits, _ and -, and begin with a letter (a to "
        "z) or _"
    )


class _WireError(Exception):
    """Raised for a wire, or one `option` of it, that is wrong."""

    def __init__(self, message: str, *value: Any, option: str | None = None) -> None:
        self.value = value
        self.key = () if option is None else (option,)
        super().__init__(message)


def _read_hops(entry: Any) -> list[tuple[str, str, dict[str, Any]]]:
    if isinstance(entry, str):
        ends = [end.strip() for end in entry.split("->")]
        if len(ends) < 2 or not all(_END.fullmatch(end) for end in ends):
            raise _WireError('must read "block -> block" or "block.output -> block.input"', entry)
        if len(ends) > 2 and any("." in end for end in ends):
            raise _WireError("ports can be named only in a wire between two blocks", entry)
        return [(a, b, {}) for a, b in pairwise(ends)]
    if not isinstance(entry, dict):
        raise _WireError('must be text such as "gate -> radar", or a table', entry)
    for name in entry:
        if name not in _KEYS:
            raise _WireError(f"unknown key {name!r}{did_you_mean(name, _KEYS)}")
    source, target = entry.get("from"), entry.get("to")
    for name, end in (("from", source), ("to", target)):
        if not isinstance(end, str) or not _END.fullmatch(end.strip()):
            raise _WireError(f'needs {name} = "block" or "block.port"', entry)
    return [(str(source).strip(), str(target).strip(), _read_wire_options(entry))]


def _read_wire_options(entry: Mapping[str, Any]) -> dict[str, Any]:
    options: dict[str, Any] = {}
    if "delay" in entry and "delay_s" in entry:
        raise _WireError("give delay or delay_s, not both", dict(entry))
    if "delay" in entry:
        match = _SCANS.fullmatch(str(entry["delay"]).strip())
        if not match or not match[1].strip("0"):
            raise _WireError('must read "1 scan" or "N scans"', entry["delay"], option="delay")
        if len(match[1]) > 9 or int(match[1]) > _MOST_SCANS:
            limit = f"must be at most {_MOST_SCANS:,} scans"
            raise _WireError(limit, entry["delay"], option="delay")
        options["delay_scans"] = int(match[1])
    for key in ("delay_s", "jitter_s"):
        if key in entry:
            options[key] = _read_seconds(key, entry[key])
    if "drop_probability" in entry:
        share = entry["drop_probability"]
        if isinstance(share, bool) or not isinstance(share, int | float) or not 0 <= share <= 1:
            raise _WireError("must be a number from 0 to 1", share, option="drop_probability")
        options["drop_probability"] = float(share)
    if "holds" in entry:
        holds = entry["holds"]
        if holds != "nothing" and not isinstance(holds, dict):
            allowed = "must be 'nothing' or a table of the message's fields"
            raise _WireError(allowed, holds, option="holds")
        options["holds"] = holds
    return options


def _read_seconds(key: str, value: Any) -> Fraction:
    try:
        seconds = parse_rational(value)
    except ValueError as error:
        raise _WireError(str(error), value, option=key) from None
    if seconds < 0:
        raise _WireError("must be 0 or greater", value, option=key)
    return seconds


def _wire_between_ends(
    source_end: str,
    target_end: str,
    options: dict[str, Any],
    classes: Mapping[str, type[Component]],
) -> Wire | None:
    source, _, output = source_end.partition(".")
    target, _, input_name = target_end.partition(".")
    for name in (source, target):
        if name not in classes:
            raise _WireError(f"the scene has no block {name!r}{did_you_mean(name, classes)}")
    source_class, target_class = classes[source], classes[target]
    if source_class is None or target_class is None:
        return None
    outputs, inputs = source_class.outputs, target_class.inputs
    if output and output not in outputs:
        raise _WireError(f"{source} has no output {output!r}{did_you_mean(output, outputs)}")
    if input_name and input_name not in inputs:
        raise _WireError(f"{target} has no input {input_name!r}{did_you_mean(input_name, inputs)}")
    fitting = [
        (o, i)
        for o in sorted(outputs)
        for i in sorted(inputs)
        if output in ("", o)
        and input_name in ("", i)
        and issubclass(outputs[o].message, inputs[i].message)
    ]
    if len(fitting) == 1:
        return Wire(source, fitting[0][0], target, fitting[0][1], **options)
    sends = ", ".join(f"{o} ({p.message.__name__})" for o, p in sorted(outputs.items())) or "none"
    takes = ", ".join(f"{i} ({p.message.__name__})" for i, p in sorted(inputs.items())) or "none"
    what = "does not fit" if not fitting else "fits in several ways; name the ports"
    raise _WireError(
        f"{source_end} -> {target_end} {what}: outputs of {source}: {sends}; "
        f"inputs of {target}: {takes}"
    )


def _report_double_writers(
    scene: SceneFile,
    wires: list[Wire],
    classes: Mapping[str, type[Component]],
) -> None:
    writers: dict[tuple[str, str], list[Wire]] = {}
    for wire in wires:
        writers.setdefault((wire.target, wire.input), []).append(wire)
    for (target, input_name), result in sorted(writers.items()):
        ends = [f"{w.source}.{w.output}" for w in result]
        if len(set(ends)) < len(ends):
            twice = sorted(end for end, count in Counter(ends).items() if count > 1)
            message = f"{', '.join(twice)} is wired to {target}.{input_name} more than once"
            scene.report(("wires",), message)
        elif len(result) > 1 and not classes[target].inputs[input_name].many:
            from_all = ", ".join(sorted(ends))
            message = f"{target}.{input_name} has {len(result)} writers, and takes one: {from_all}"
            scene.report(("wires",), message)


def add_block_latencies(wires: list[Wire], options: Mapping[str, BlockOptions]) -> list[Wire]:
    """Return the wires with senders' latency added, and those through shared processors marked."""
    return [
        replace(
            wire,
            latency_s=options[wire.source].latency_s,
            queued=options[wire.source].processor is not None,
        )
        if wire.source in options
        else wire
        for wire in wires
    ]
