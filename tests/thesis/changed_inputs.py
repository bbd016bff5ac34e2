"""Changing one input of a row, as `Basis.inputs` names it, while an item is made again."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from components.thesis import flight_tests, scenes
from components.thesis.scenes import configs
from dsa_des.scene.scene import scene_from_tables
from dsa_des.scene.scene_file import SceneFile, read_scene_file

FACTOR = 0.93


def changed(value: Any) -> Any:
    """Return another value of the same kind: a number times 0.93, a list of tables one shorter."""
    if isinstance(value, (bool, str)):
        return value
    if isinstance(value, int):
        return round(FACTOR * value) if abs(value) > 10 else value - 1
    if isinstance(value, float):
        return FACTOR * value
    if isinstance(value, dict):
        return {key: changed(one) for key, one in value.items()}
    if value and isinstance(value[0], dict):
        return value[:-1]
    return type(value)(changed(one) for one in value)


def found(data: Any, key: str) -> tuple[Any, Any]:
    """Return the table or list that holds a dotted key, and the key in it."""
    *way, last = key.split(".")
    for step in way:
        if isinstance(data, list):
            data = next(one for one in data if one["name"] == step)
        else:
            data = data[step]
    assert last in data, key
    return data, last


def change(monkeypatch: Any, inputs: tuple[str, ...]) -> None:
    """Change these inputs until the test ends."""
    keys: dict[str, list[str]] = {}
    for name in inputs:
        file, key = name.split(":")
        if "." in file:
            keys.setdefault(file, []).append(key)
        else:
            module = __import__(f"components.thesis.{file}", fromlist=["_"])
            monkeypatch.setattr(module, key, changed(getattr(module, key)))

    def apply(path: Path, scene_file: SceneFile) -> None:
        for key in keys.get(str(Path(path).relative_to(configs())), []):
            table, last = found(scene_file.data, key)
            table[last] = changed(table[last])

    rewrite(monkeypatch, apply)
    if "thesis/table_4_2.csv" in keys:
        (column,) = keys["thesis/table_4_2.csv"]
        rows = [{**row, column: FACTOR * float(row[column])} for row in scenes.read_thesis_csv(
            "table_4_2.csv")]  # fmt: skip
        monkeypatch.setattr(flight_tests, "read_thesis_csv", lambda name: rows)


def rewrite(monkeypatch: Any, apply: Callable[[Path, SceneFile], None]) -> None:
    """Let a function change every file of ``configs`` after it is read."""

    def read(path: Path) -> SceneFile:
        scene_file = read_scene_file(path).copy()
        apply(path, scene_file)
        return scene_file

    def load(path: Path, sets: Any = (), swaps: Any = ()) -> Any:
        return scene_from_tables(read(path), sets=sets, swaps=swaps, seed=None, duration_s=None)

    monkeypatch.setattr(scenes, "read_scene_file", read)
    monkeypatch.setattr(scenes, "load_scene", load)
