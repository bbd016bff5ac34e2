"""``dsa-des components`` and ``examples``: block types, and shipped scenes, studies and cases."""

import inspect
import os
import typing
from pathlib import Path
from typing import Any

from rich.table import Table
from rich.text import Text

from dsa_des.block.component import Component
from dsa_des.block.entry_points import entry_points_of
from dsa_des.block.ladder import Ladder
from dsa_des.block.registry import UnknownType, find_component
from dsa_des.block.shipped_files import example_folders
from dsa_des.commands.parameters import Row, parameter_rows, scene_tables
from dsa_des.errors import OutputError, UsageError, did_you_mean, nearest_name
from dsa_des.files.output_file import temporary_folder
from dsa_des.files.output_names import (
    absolute_location,
    check_folder_path,
    system_error_text,
    user_path,
)
from dsa_des.scene.block_table import BlockOptions
from dsa_des.scene.examples import Example, examples
from dsa_des.terminal import terminal
from dsa_des.terminal.terminal import say
from dsa_des.text.safe_text import escape_unprintable

_PARAMETER_HEADS = ("  name", "type", "unit", "default", "meaning")


def show_components(name: str | None, key: str | None = None) -> None:
    """Print the list of block types, those of one kind, the description of one, or of its key."""
    console = terminal.console(120)
    kinds = {one.partition(".")[0] for one in entry_points_of()}
    if name is None:
        _print_type_list(console, list(entry_points_of()))
        console.print()
        console.print("dsa-des components TYPE describes one; module:Class works as a type too.")
        console.print(
            "So are tables of scenes: scene, extends, blocks, wires, processors, weather, ..."
        )
        return
    if name in kinds and name not in entry_points_of() and key is None:
        _print_type_list(
            console, [one for one in entry_points_of() if one.partition(".")[0] == name]
        )
        return
    table = scene_tables().get(name)
    if table is not None:
        what, rows = table
        _print_scene_table(console, name, what, lambda: _rows_of_key(name, key, rows()))
        return
    try:
        cls = find_component(name)
    except UnknownType as error:
        known = [*entry_points_of(), *kinds, *scene_tables()]
        close = nearest_name(name, known)
        hint = f"; did you mean {close!r}?" if close else f"; kinds: {', '.join(sorted(kinds))}"
        message = f"{name}: there is no such block type, kind of blocks or table of scenes{hint}"
        raise UsageError(message if ":" not in name else f"{name}: {error}") from error
    if key is not None:
        keys = parameter_rows(cls.Parameters) + parameter_rows(BlockOptions)
        _print_rows(console, _PARAMETER_HEADS, _rows_of_key(name, key, keys))
        return
    _print_type(console, name, cls)


def _rows_of_key(name: str, key: str | None, rows: list[Row]) -> list[Row]:
    """Return the rows of one key and of the keys inside it; all rows if no key is given."""
    if key is None:
        return rows
    matches = [row for row in rows if f"{row[0].strip()}.".startswith(f"{key}.")]
    if not matches:
        hint = did_you_mean(key, [row[0].strip() for row in rows])
        raise UsageError(f"{name}: has no key {key!r}{hint}")
    return matches


def _print_type_list(console: Any, names: typing.Sequence[str]) -> None:
    table = Table(box=None, pad_edge=False)
    for heading in ("type", "takes", "sends", "what it is"):
        table.add_column(heading, no_wrap=heading == "type")
    for name in names:
        try:
            cls = find_component(name)
        except UnknownType as error:  # a broken plug-in must not hide the others
            table.add_row(name, "", "", f"cannot be loaded: {error}")
            continue
        table.add_row(name, _ports_text(cls.inputs), _ports_text(cls.outputs), _first_sentence(cls))
    console.print(table)


def _print_scene_table(
    console: Any, name: str, what: str, rows: typing.Callable[[], list[typing.Any]]
) -> None:
    console.print(Text.assemble((name, "bold"), f"  {what}"))
    _print_rows(
        console,
        _PARAMETER_HEADS,
        [[Text(f"  {first}"), *map(Text, rest)] for first, *rest in rows()],
    )


def _print_rows(
    console: Any, headings: typing.Sequence[str], rows: typing.Iterable[typing.Sequence[Any]]
) -> None:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in headings:
        table.add_column(heading, no_wrap=heading.startswith("  "))
    for row in rows:
        table.add_row(*row)
    console.print(table, highlight=False)


def _ports_text(ports: typing.Mapping[str, Any]) -> str:
    return ", ".join(sorted(ports)) or "-"


def _first_sentence(cls: type[Component]) -> str:
    return (cls.__doc__ or "").strip().split("\n\n")[0].replace("\n", " ")


def _print_type(console: Any, name: str, cls: type[Component]) -> None:
    console.print(
        Text.assemble(
            (escape_unprintable(name), "bold"), f"  {escape_unprintable(cls.import_path())}"
        )
    )
    console.print(Text(inspect.cleandoc(cls.__doc__ or "")))
    console.print()
    console.print(f"look-ahead windows: {'yes' if cls.windowed else 'no'}", highlight=False)
    sides: list[tuple[str, typing.Mapping[str, Any]]] = [
        ("inputs", cls.inputs),
        ("outputs", cls.outputs),
    ]
    for title, ports in sides:
        console.print()
        console.print(title, style="bold")
        if not ports:
            console.print("  none")
        for port, declared in sorted(ports.items()):
            mode = f", {declared.mode}" if title == "inputs" else ""
            many = ", many writers" if getattr(declared, "many", False) else ""
            optional = "" if getattr(declared, "required", True) else ", optional"
            line = f"  {port} ({declared.message.__name__}{mode}{many}{optional}): {declared.doc}"
            console.print(line, highlight=False)
    console.print()
    console.print("parameters", style="bold")
    _print_rows(console, _PARAMETER_HEADS, parameter_rows(cls.Parameters))
    _print_hooks(console, cls)
    for ladder in cls.ladders:
        _print_ladder(console, ladder)


def _print_hooks(console: Any, cls: type[Component]) -> None:
    """Print the quantities that effects can act on, their call, and which effects do."""
    hooks = cls.all_hooks()
    if not hooks:
        return
    console.print()
    console.print("hooks, what effects may act on", style="bold")
    acting = {
        hook: ", ".join(effect.name for effect in cls.effects if effect.acts_on == hook)
        for hook in hooks
    }
    rows = [(f"  {hook}", hook.signature_text(), acting[hook] or "-") for hook in sorted(hooks)]
    _print_rows(console, ("  hook", "what it calls", "effects"), rows)


def _print_ladder(console: Any, ladder: Ladder) -> None:
    units = ", ".join(f"{quantity.name} ({quantity.unit})" for quantity in ladder.quantities)
    console.print()
    console.print(f"ladder {ladder.name}, crude to exact; rungs differ in {units}", style="bold",
                  highlight=False)  # fmt: skip
    names = [f"  {r.name}{' (reference)' * (r.name == ladder.reference)}" for r in ladder.rungs]
    rows = [(name, r.type_name or "as it is", r.what)
            for name, r in zip(names, ladder.rungs, strict=True)]  # fmt: skip
    _print_rows(console, ("  rung", "type", "what it is"), rows)


_HEADINGS = {
    "scene": "Scenes: dsa-des run NAME",
    "study": "Studies: dsa-des study NAME",
    "case": "Cases, from requirement to verdict: dsa-des evidence NAME",
}
_OPTION = "--copy"
_CODE = "__pycache__"


def list_or_copy_examples(copy: str | None) -> None:
    """Print a list of all shipped scenes, studies and cases, or copy their folders to `copy`."""
    if copy is not None:
        _copy_example_folders(user_path(copy, _OPTION))
        return
    shipped = examples()
    if not shipped:
        say("no installed package ships scenes or studies")
    width = max((len(example.name) for example in shipped), default=0)
    for kind, heading in _HEADINGS.items():
        of_kind = [example for example in shipped if example.kind == kind]
        if of_kind:
            say(heading)
        for example in of_kind:
            say(_example_line(example, width))


def _example_line(example: Example, width: int) -> str:
    return f"  {example.name:<{width}}  {' '.join(example.title.split())}"


def _copy_example_folders(target: Path) -> None:
    """Copy the folders of all packages; several each into a folder of the package's name."""
    sources = example_folders()
    if not sources:
        raise UsageError("no installed package ships scenes or studies")
    check_folder_path(target, _OPTION)
    try:
        if os.path.lexists(target) and any(target.iterdir()):
            raise UsageError(f"{_OPTION} {target}: is not empty; a new folder is needed")
        path = absolute_location(target)
        with temporary_folder(path) as folder:
            copied = folder / "copy"
            copied.mkdir()
            several = len(sources) > 1
            count = sum(
                _copy_and_count_files(source, copied / source.parent.name if several else copied)
                for source in sources
            )
            if path.exists():
                path.rmdir()
            copied.rename(path)
    except OSError as error:
        raise OutputError(
            f"{_OPTION} {target}: cannot be written: {system_error_text(error)}"
        ) from error
    say(f"{target}: {count} files")


def _copy_and_count_files(source: Path, into: Path) -> int:
    """Copy all files below a folder (content, not permissions); return how many there were."""
    files = [path for path in sorted(source.rglob("*")) if path.is_file()]
    files = [path for path in files if _CODE not in path.parts]
    for path in files:
        copy = into / path.relative_to(source)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    return len(files)
