"""Reading ``[[changes]]``: what of a scene is otherwise from an instant on, or for a while.

::

    [[changes]]
    from_s = 30
    to_s = 45
    set = { "blocks.radar.enabled" = false }

Between two instants at which something changes lies a stretch. Each is a scene of its own, read and
checked as any other; what is the same in it is shared with the one before.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from math import lcm
from typing import Any

from dsa_des.block.component import to_scene_number
from dsa_des.block.parameters import nested_models
from dsa_des.block.registry import section_models
from dsa_des.errors import SceneError, did_you_mean, shortened_repr
from dsa_des.scene.block_table import BlockOptions, ProcessorParameters
from dsa_des.scene.keys import Key, dotted_key, explain_no_item, flatten_tables, parse_key_path
from dsa_des.scene.overrides import set_value
from dsa_des.scene.scene_file import SceneFile
from dsa_des.scene.wiring import MAY_CHANGE as OF_WIRES
from dsa_des.scene.wiring import Wire
from dsa_des.time.clock import MAX_TICK, parse_rational

CHANGES = "changes"
_INSTANTS = ("from_s", "to_s", "at_s")
_KEYS = (*_INSTANTS, "set")


@dataclass(frozen=True)
class TimedChange:
    """Values that some keys take from an instant to the end of the run or to a later instant.

    Parameters
    ----------
    number : int
        Its place in ``changes``.
    from_s : Fraction
    to_s : Fraction or None
        First instant at which the keys have their former values again; None of a change for good,
        which holds until the next one of the same key.
    values : mapping
        By dotted key.
    keys : tuple of Key
        Where these are in the scene's tables.
    resolved : mapping
        The same values by dotted key of the scene as it is written out (`Scene.resolved`), which
        has its wires in another order.
    """

    number: int
    from_s: Fraction
    to_s: Fraction | None
    values: Mapping[str, Any]
    keys: tuple[Key, ...]
    resolved: Mapping[str, Any]

    def sentence(self) -> str:
        """Return, for example, ``from 30 s to 45 s: blocks.radar.enabled = false``."""
        until = " on" if self.to_s is None else f" to {float(self.to_s):g} s"
        values = ", ".join(
            f"{key} = {str(value).lower() if isinstance(value, bool) else shortened_repr(value)}"
            for key, value in self.values.items()
        )
        return f"from {float(self.from_s):g} s{until}: {values}"

    def to_table(self) -> dict[str, Any]:
        """Return the change as an entry of ``changes``."""
        from_s = to_scene_number(self.from_s)
        when = {"at_s": from_s} if self.to_s is None else {
            "from_s": from_s, "to_s": to_scene_number(self.to_s)
        }  # fmt: skip
        return {**when, "set": dict(self.resolved)}


@dataclass(frozen=True)
class Stretch:
    """The scene from an instant of change on, and the keys that then differ from its start."""

    from_s: Fraction
    scene: Any
    keys: tuple[str, ...]


def read_timed_changes(
    scene_file: SceneFile, blocks: Mapping[str, Any], wires: Sequence[Wire]
) -> list[TimedChange]:
    """Return the timed changes of a scene; what is wrong with them is added to its problems.

    `blocks` are the classes of the scene's blocks, None where one is not known; `wires` those read.
    """
    entries = scene_file.data.get(CHANGES, [])
    if not isinstance(entries, list):
        scene_file.report((CHANGES,), "must be a list of tables: [[changes]]", entries)
        return []
    read = [
        change
        for number, entry in enumerate(entries)
        if (change := _read_entry(scene_file, number, entry, blocks, wires)) is not None
    ]
    for one, other in combinations(read, 2):
        _report_overlap(scene_file, one, other)
    return read


def _read_entry(
    scene_file: SceneFile,
    number: int,
    entry: Any,
    blocks: Mapping[str, Any],
    wires: Sequence[Wire],
) -> TimedChange | None:
    at: Key = (CHANGES, number)
    before = len(scene_file.problems)
    if not isinstance(entry, dict):
        scene_file.report(at, 'must be a table: at_s = 30, set = { "blocks.x.y" = 1 }', entry)
        return None
    for key in entry:
        if key not in _KEYS:
            scene_file.report((*at, key), f"unknown key of a change{did_you_mean(key, _KEYS)}")
    times = {
        key: _read_instant_s(scene_file, (*at, key), entry[key])
        for key in _INSTANTS
        if key in entry
    }
    if times.keys() not in ({"at_s"}, {"from_s", "to_s"}):
        said = " and ".join(times) or "nothing"
        message = f"says {said}: give at_s, for good, or from_s and to_s, for a while"
        scene_file.report(at, message)
        return None
    from_s, to_s = times.get("at_s", times.get("from_s")), times.get("to_s")
    if from_s is not None and to_s is not None and to_s <= from_s:
        message = f"must be later than from_s, {float(from_s):g}"
        scene_file.report((*at, "to_s"), message, entry["to_s"])
    given = entry.get("set")
    if not isinstance(given, dict) or not given:
        message = 'must be a table of keys and values: set = { "blocks.radar.enabled" = false }'
        scene_file.report((*at, "set"), message, *([] if given is None else [given]))
        return None
    values = flatten_tables(given)
    keys = []
    for text, value in values.items():
        keys.append(key := parse_key_path(scene_file.data, text))
        if reason := _explain_unchangeable_key(scene_file, key, blocks):
            scene_file.report((*at, "set", text), reason, value)
    if from_s is None or len(scene_file.problems) > before:
        return None
    resolved = {
        _renumber_wire_key(scene_file, text, key, wires): value
        for (text, value), key in zip(values.items(), keys, strict=True)
    }
    return TimedChange(number, from_s, to_s, values, tuple(keys), resolved)


def _renumber_wire_key(scene_file: SceneFile, text: str, key: Key, wires: Sequence[Wire]) -> str:
    """Return a dotted key with a written wire number replaced by that among the sorted wires."""
    if key[0] != "wires":
        return text
    entry = scene_file.data["wires"][key[1]]
    ends = str(entry).split("->")
    if isinstance(entry, dict):
        ends = [str(entry.get("from", "")), str(entry.get("to", ""))]
    first, last = (end.strip() for end in (ends[0], ends[-1]))
    for place, wire in enumerate(wires):
        sends = (wire.source, f"{wire.source}.{wire.output}")
        takes = (wire.target, f"{wire.target}.{wire.input}")
        if first in sends and last in takes:
            return dotted_key(("wires", place, *key[2:]))
    return text


def _read_instant_s(scene_file: SceneFile, key: Key, value: Any) -> Fraction | None:
    try:
        seconds = parse_rational(value)
        if seconds < 0:
            raise ValueError("must be 0 or greater")
    except ValueError as error:
        scene_file.report(key, str(error), value)
        return None
    return seconds


def _explain_unchangeable_key(scene_file: SceneFile, key: Key, blocks: Mapping[str, Any]) -> str:
    """Return why a key cannot change during a run, with keys that can; empty if it can."""
    rest: list[str | int]
    first, name, *rest = (*key, "", "")
    if first == "blocks" and name in blocks:
        if (cls := blocks[name]) is None:
            return ""  # what is wrong with it is said already
        key = key[2:]
        of_tables, inside = _changeable_keys_and_rest(cls.Parameters, key)
        allowed = changeable_keys(BlockOptions) if len(inside) >= len(key) else ()
        if cls.remembers is not None or cls.heeds_changes:
            allowed, rest = allowed + of_tables, list(inside)
        elif inside[0] in of_tables:
            return (
                f"cannot change while a run lasts: {cls.import_path()} does not say what it "
                f"remembers "
                "(Component.remembers)"
            )
        what = f"blocks.{name}, a {cls.__name__},"
    elif first == "wires" and not isinstance(name, int):
        return explain_no_item(scene_file.data.get("wires", []), str(name))
    elif first == "wires":
        allowed, what, rest = OF_WIRES, f"wires[{name}]", rest[:-1]
    elif first == "processors" and name in scene_file.data.get("processors", {}):
        allowed, what, rest = changeable_keys(ProcessorParameters), f"processors.{name}", rest[:-1]
    elif first in section_models():
        allowed, what, rest = changeable_keys(section_models()[str(first)]), f"[{first}]", [name]
    else:
        known = [*(f"blocks.{n}" for n in blocks), "wires", "processors", *section_models()]
        hint = did_you_mean(dotted_key(key[:2]), known)
        return f"is no key of this scene that can change while a run lasts{hint}"
    if rest and rest[0] in allowed:
        return ""
    if not allowed:
        return f"cannot change while a run lasts: {what} has no key that can"
    hint = did_you_mean(str(rest[0]) if rest else "", allowed)
    return f"cannot change while a run lasts; {what} can change others{hint}"


def _changeable_keys_and_rest(
    model: type[Any], key: Sequence[str | int]
) -> tuple[tuple[str, ...], Sequence[str | int]]:
    """Return the keys that may change in the innermost table along `key`, and the rest of `key`."""
    models = [model]
    for place, part in enumerate(key):
        if part in (allowed := changeable_keys(*models)) or place == len(key) - 1:
            return allowed, key[place:]
        fields = [one.model_fields[str(part)] for one in models if part in one.model_fields]
        # An item's number or name leads into no other table.
        models = [inner for of in fields for inner in nested_models(of.annotation)] or models
    return changeable_keys(model), ("",)


def changeable_keys(*models: type[Any]) -> tuple[str, ...]:
    """Return the keys of some tables that may change during a run, as their classes declare."""
    found = dict.fromkeys(
        name
        for model in models
        for base in reversed(model.__mro__)
        for name in vars(base).get("may_change", ())
    )
    return tuple(found)


def _report_overlap(scene_file: SceneFile, one: TimedChange, other: TimedChange) -> None:
    """Report two changes that set the same key and are in force at the same time."""
    if other.from_s < one.from_s:
        one, other = other, one
    for text, key in zip(other.values, other.keys, strict=True):
        if not any(_is_either_in_other(key, mine) for mine in one.keys):
            continue
        inside = one.to_s is not None and other.from_s < one.to_s
        if inside or one.from_s == other.from_s:
            until = "on" if one.to_s is None else f"to {float(one.to_s):g} s"
            message = (
                f"is set by changes[{one.number}] too, from {float(one.from_s):g} s {until}: "
                "changes of one key must not overlap"
            )
            scene_file.report((CHANGES, other.number, "set", text), message)


def _is_either_in_other(one: Key, other: Key) -> bool:
    """Return whether keys are equal, or either is inside the other."""
    shorter = min(len(one), len(other))
    return one[:shorter] == other[:shorter]


def stretches_of(
    scene_file: SceneFile,
    scene: Any,
    changes: list[TimedChange],
    check: Callable[[SceneFile], Any],
) -> list[Stretch]:
    """Return the scene after each instant at which something changes, in order of time.

    `check` makes a scene of tables; what is wrong with one of them is reported at its change.
    """
    _check_late_changes(scene_file, scene.duration_s, changes, scene.notes)
    if scene_file.problems:
        return []
    instants = sorted(
        {
            instant
            for change in changes
            for instant in (change.from_s, change.to_s)
            if instant is not None and (scene.duration_s is None or instant < scene.duration_s)
        }
    )
    stretches: list[Stretch] = []
    before = scene
    for instant in instants:
        file = scene_file.copy()
        del file.data[CHANGES]
        keys: dict[str, None] = {}
        for change in _changes_in_force(changes, instant):
            source = (
                f"{scene_file.source_file_of((CHANGES, change.number))}: changes[{change.number}]"
            )
            for text, value in change.values.items():
                file.problems += set_value(file, text, value, source)
                keys[text] = None
        try:
            before = _share_equal_parts(check(file), [before, scene])
        except SceneError as error:
            scene_file.problems += error.problems
            continue
        stretches.append(Stretch(instant, before, tuple(keys)))
    return stretches


def _check_late_changes(
    scene_file: SceneFile,
    duration_s: Fraction | None,
    changes: list[TimedChange],
    notes: list[str],
) -> None:
    """Report changes after the run's end, but only note them if another file sets that end."""
    if duration_s is None:
        return
    for change in changes:
        first = "at_s" if change.to_s is None else "from_s"
        late = [first] if change.from_s >= duration_s else []
        late += ["to_s"] if change.to_s is not None and change.to_s > duration_s else []
        for key in late:
            at: Key = (CHANGES, change.number, key)
            message = f"is beyond the run's end, {float(duration_s):g} s"
            if scene_file.source_file_of(at) == scene_file.source_file_of(("duration_s",)):
                scene_file.report(at, message, scene_file.data[CHANGES][change.number][key])
            elif key == first:
                notes.append(f"{dotted_key(at)} is {float(change.from_s):g}: it {message}")


def _changes_in_force(changes: list[TimedChange], instant: Fraction) -> Iterator[TimedChange]:
    """Yield the changes in force at an instant: the lasting ones by time, then the temporary."""
    for change in sorted(changes, key=lambda one: (one.to_s is not None, one.from_s)):
        if change.from_s <= instant and (change.to_s is None or instant < change.to_s):
            yield change


def _share_equal_parts(scene: Any, others: list[Any]) -> Any:
    """Return the scene with blocks and sections equal to others' replaced by the same objects."""
    blocks = {
        name: next((o.blocks[name] for o in others if o.blocks.get(name) == block), block)
        for name, block in scene.blocks.items()
    }
    sections = {
        name: next((o.sections[name] for o in others if o.sections[name] == section), section)
        for name, section in scene.sections.items()
    }
    return replace(scene, blocks=blocks, sections=sections)


def common_ticks_per_s(scene_file: SceneFile, scene: Any) -> int:
    """Return the ticks per second in which all times of a scene and its stretches are whole.

    More than 64 bits can count is reported.
    """
    own = [stretch.from_s.denominator for stretch in scene.stretches]
    of_each = [stretch.scene.ticks_per_s for stretch in scene.stretches]
    ticks_per_s = lcm(scene.ticks_per_s, *own, *of_each)
    if ticks_per_s * (1 + (scene.duration_s or 0)) >= MAX_TICK:
        message = "their instants, and the clocks then, have no common tick that fits 64 bits"
        scene_file.report((CHANGES,), message)
        return scene.ticks_per_s
    return ticks_per_s
