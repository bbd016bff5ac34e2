"""``dsa-des graph``: the blocks and wires of a scene as text, DOT or a picture."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Unpack

import networkx as nx

from dsa_des.commands.scene import SceneOptions, load_scene_printing_notes
from dsa_des.errors import OutputError, UsageError
from dsa_des.files.output_file import PICTURES, check_file_ending, check_file_writable
from dsa_des.files.output_names import user_path
from dsa_des.record.drawing import draw_to_png, figure_text
from dsa_des.running.grain import choose_grain
from dsa_des.scene.graph import block_depths
from dsa_des.scene.scene import Scene
from dsa_des.scene.wiring import Wire
from dsa_des.terminal.terminal import console, say, say_lines
from dsa_des.text.safe_text import escape_unprintable, shorten


def show_graph(dot: bool, png: bool, out: str | None, **options: Unpack[SceneOptions]) -> None:
    """Print or draw the graph of a scene."""
    if dot and png:
        raise UsageError("give --dot or --png, not both")
    loaded = load_scene_printing_notes(**options)
    if dot:
        say_lines(to_dot(loaded))
    elif png:
        path = Path(f"{loaded.path.stem}-graph.png") if out is None else user_path(out)
        check_file_ending(path, PICTURES)
        check_file_writable(path)
        draw_graph(loaded, path)
        say(f"wrote {path}")
    else:
        _print_table(loaded)


def _sorted_wires(scene: Scene) -> list[Wire]:
    return sorted(scene.wires, key=lambda w: (w.source, w.output, w.target, w.input))


def _delay_label(wire: Wire) -> str:
    if wire.delay_scans:
        return f"{wire.delay_scans} scan{'s' if wire.delay_scans > 1 else ''} later"
    return f"{float(wire.delay_s):g} s later" if wire.delay_s else ""


def _print_table(scene: Scene) -> None:
    from rich.table import Table

    depth = block_depths(scene.graph)
    windowed = choose_grain(scene, None).windowed
    table = Table(title=f"{shorten(scene.title)}: blocks in the order they run within an instant")
    for heading in ("depth", "block", "type", "runs", "fed by"):
        table.add_column(heading)
    for name in sorted(scene.blocks, key=lambda n: (depth[n], n)):
        block = scene.blocks[name]
        spec = block.cls.clock_of(block.parameters)
        when = f"{float(spec.rate_hz):g} Hz" if spec else (
            "on demand" if block.cls.clocked == "demand" else "when triggered"
        )  # fmt: skip
        grain = "look-ahead" if name in windowed else "scan by scan"
        fed = [
            f"{shorten(w.source)}.{w.output}" + (f" ({_delay_label(w)})" if w.is_delayed else "")
            for w in _sorted_wires(scene)
            if w.target == name
        ]
        who = shorten(name), shorten(block.type_name)
        table.add_row(str(depth[name]), *who, f"{when}, {grain}", ", ".join(fed))
    console().print(table)


def to_dot(scene: Scene) -> str:
    """Return the graph in Graphviz's DOT language, always in the same order."""
    lines = [f'digraph "{_escape_dot(scene.title)}" {{', "  rankdir=LR;", "  node [shape=box];"]
    for name, block in scene.blocks.items():
        shown = f"{_escape_dot(name)}\\n{_escape_dot(block.type_name)}"
        lines.append(f'  "{_escape_dot(name)}" [label="{shown}"];')
    for wire in _sorted_wires(scene):
        message = scene.blocks[wire.source].cls.outputs[wire.output].message.__name__
        sent = message + (f"\\n{_delay_label(wire)}" if wire.is_delayed else "")
        style = ", style=dashed" if wire.is_delayed else ""
        ends = f'"{_escape_dot(wire.source)}" -> "{_escape_dot(wire.target)}"'
        lines.append(f'  {ends} [label="{sent}"{style}];')
    return "\n".join([*lines, "}"])


def _escape_dot(text: str) -> str:
    return escape_unprintable(text).replace("\\", "\\\\").replace('"', '\\"')


def draw_graph(scene: Scene, path: Path) -> None:
    """Draw the graph from left to right by depth."""
    depth = block_depths(scene.graph)
    position = _block_positions(scene.graph, depth)
    columns = max(depth.values()) + 1
    rows = max(list(depth.values()).count(d) for d in set(depth.values()))
    try:
        with draw_to_png(1.2 + 2.1 * columns, 1.2 + 1.1 * rows, path) as figure:
            axes = figure.add_axes((0, 0, 1, 0.9))
            axes.set_axis_off()
            axes.set_xlim(-0.6, columns - 0.4)
            axes.set_ylim(-rows / 2 - 0.2, rows / 2 + 0.2)
            figure.suptitle(figure_text(scene.title, 80), fontsize=12)
            _draw_blocks(axes, scene, position)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from error


def _draw_blocks(axes: Any, scene: Scene, position: Mapping[str, tuple[float, float]]) -> None:
    boxes = {}
    for name, (x, y) in position.items():
        kind = figure_text(scene.blocks[name].type_name, 24)
        boxes[name] = axes.text(
            x, y, f"{figure_text(name, 24)}\n{kind}", ha="center", va="center", fontsize=8,
            bbox={"boxstyle": "round,pad=0.5", "facecolor": "#eef3f8", "edgecolor": "#33557a"},
        )  # fmt: skip
    for wire in _sorted_wires(scene):
        _draw_wire(axes, wire, position, boxes)


def _block_positions(graph: nx.DiGraph, depth: Mapping[str, int]) -> dict[str, tuple[float, float]]:
    position = {}
    for level in sorted(set(depth.values())):
        names = sorted(name for name in graph if depth[name] == level)
        for row, name in enumerate(names):
            position[name] = (float(level), (len(names) - 1) / 2 - row)
    return position


def _draw_wire(
    axes: Any, wire: Wire, position: Mapping[str, tuple[float, float]], boxes: Mapping[str, Any]
) -> None:
    (x0, y0), (x1, y1) = position[wire.source], position[wire.target]
    backward = x1 <= x0
    axes.annotate(
        "",
        xy=(x1, y1),
        xytext=(x0, y0),
        arrowprops={
            "arrowstyle": "-|>",
            "color": "#b4532a" if wire.is_delayed else "#555555",
            "linestyle": "--" if wire.is_delayed else "-",
            "patchA": boxes[wire.source].get_bbox_patch(),
            "patchB": boxes[wire.target].get_bbox_patch(),
            "shrinkA": 1,
            "shrinkB": 1,
            "connectionstyle": "arc3,rad=-0.35" if backward else "arc3,rad=0",
        },
    )
    if wire.is_delayed:
        height = 0.35 * abs(x1 - x0) if backward else 0.0
        axes.text((x0 + x1) / 2, (y0 + y1) / 2 - height, _delay_label(wire), fontsize=7,
                  ha="center", va="center", color="#b4532a")  # fmt: skip
