"""Hostile text wherever a scene or study takes text: nothing raw on the terminal, no traceback.

Where text is allowed is read from the parameter models, so that a new parameter is tried as well.
"""

import io
import json
import tomllib
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_origin

import pytest
from click.testing import CliRunner, Result
from pydantic import BaseModel

from dsa_des.block.registry import find_component, section_models
from dsa_des.cli import main
from dsa_des.files.toml_files import to_toml
from dsa_des.scene.block_table import BlockOptions
from dsa_des.scene.scene import load_scene

CONFIGS = Path(__file__).parent.parent.parent / "configs"
SCENE = CONFIGS / "first_light.toml"
#: Everything that a terminal, Rich, Matplotlib or a reader of lines might obey, in one text.
HOSTILE = (
    "_[/][bold]$x^{$\\alpha\\ \x1b[31m\x1b]0;t\x07\x08\r\nerror: forged\t\x7f\x85\x9b2J"
    "\u200b\u2028\u202e\u2066\ufeff\u6f22:smile:" + "long " * 60
)
SHORT = "_$x^{$[/]\x1b[31m\x9b\u202e\n\r"
KINDS = {"everything": HOSTILE, "short": SHORT}


def call(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def bad_letters(text: str) -> set[str]:
    return {
        letter
        for letter in text
        if letter != "\n" and unicodedata.category(letter) in ("Cc", "Cf", "Cs", "Co", "Zl", "Zp")
    }


def decent(result: Result, *codes: int) -> None:
    """Check that a call ended as it should and showed nothing raw."""
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code in (codes or (0, 2)), result.output
    assert not bad_letters(result.stdout) and not bad_letters(result.stderr)
    assert "\nerror: forged" not in result.output
    assert "Traceback" not in result.output


def text_keys(model: Any, prefix: tuple[str, ...] = (), depth: int = 0) -> Iterator[str]:
    """Give the dotted keys of a model that take text, or a name among several."""
    for name, info in model.model_fields.items():
        if depth < 4:
            yield ".".join((*prefix, name))
            for inner in models_in(info.annotation):
                place = "[0]" if get_origin(info.annotation) in (list, tuple) else ""
                yield from text_keys(inner, (*prefix, f"{name}{place}"), depth + 1)


def models_in(annotation: Any) -> list[Any]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for argument in get_args(annotation) for model in models_in(argument)]


def places() -> list[str]:
    scene = load_scene(SCENE)
    keys = ["title", "description", "duration_s", "seed", "extends", "blocks", "wires[0]",
            "processors.cpu", "wires[1].from", "wires[1].delay", "wires[1].holds"]  # fmt: skip
    for name, block in scene.blocks.items():
        models = (block.cls.Parameters, BlockOptions)
        keys += [f"blocks.{name}.{key}" for model in models for key in text_keys(model)]
        keys.append(f"blocks.{name}.type")
    for name, model in section_models().items():
        keys += [f"{name}.{key}" for key in text_keys(model)]
    for name in ("traffic.daa_file", "traffic.csv", "radar.swerling"):
        keys += [f"blocks.own.{key}" for key in text_keys(find_component(name).Parameters)]
    return list(dict.fromkeys(keys))


@pytest.mark.parametrize("start", range(8))
def test_hostile_values_anywhere_in_a_scene(start: int) -> None:
    keys = places()
    assert len(keys) > 150  # the models were found
    for number, key in enumerate(keys[start::8]):
        decent(call("check", SCENE, "--set", f"{key}={json.dumps(SHORT)}"))
        if number % 3 == 0:  # a name in a table of each model
            decent(call("check", SCENE, "--set", f"{key}.{SHORT}=1"))


def scene_of(folder: Path, text: str) -> Path:
    """Write a scene in which every name that may be anything is `text`."""
    tables = load_scene(SCENE).resolved()
    tables |= {"title": text, "description": text, "duration_s": 12}
    tables["blocks"]["traffic"]["intruders"][0]["name"] = text
    path = folder / "scene.toml"
    path.write_text(to_toml(tables), encoding="utf-8")
    assert tomllib.loads(path.read_text(encoding="utf-8"))["title"] == text
    return path


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", KINDS)
def test_hostile_names_in_every_command(tmp_path: Path, kind: str) -> None:
    path = scene_of(tmp_path, KINDS[kind])
    decent(call("check", path), 0)
    decent(call("explain", path), 0)
    for form in ((), ("--dot",), ("--png", "--out", tmp_path / "g.png")):
        decent(call("graph", path, *form), 0)
    decent(call("run", path, "--out", tmp_path / "run"), 0)
    result = call("run", path, "--out", tmp_path / "run2", "--json")
    decent(result, 0)
    assert KINDS[kind] in json.loads(result.stdout)["targets"]
    for name in ("plan.png", "timeline.png"):
        assert (tmp_path / "run" / name).read_bytes().startswith(b"\x89PNG")


@pytest.mark.filterwarnings("error")
def test_hostile_names_in_the_cost_of_accuracy(tmp_path: Path) -> None:
    path = scene_of(tmp_path, HOSTILE)
    only = ("--block", "transform", "--repeats", "1", "--duration", "3")
    decent(call("cost", path, *only, "--out", tmp_path / "c"), 0)
    result = call("cost", path, *only, "--json", "--out", tmp_path / "d")
    decent(result, 0)
    assert json.loads(result.stdout)
    assert result.stdout.isascii()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", KINDS)
def test_hostile_names_in_a_study(tmp_path: Path, kind: str) -> None:
    text = KINDS[kind]
    value = text.replace("[", "<").replace("/", "|")[:200]  # no pattern of files
    scene = scene_of(tmp_path, text)
    study = tmp_path / "study.toml"
    tables = {
        "title": text, "description": text, "scene": str(scene), "replicas": 3,
        "metrics": ["first_detection", "detection_share"], "set": {"duration_s": 4},
        "axes": {"title": [value, value + "2", "plain"]},
        "compare": {"axis": "title", "baseline": "plain"},
    }  # fmt: skip
    study.write_text(to_toml(tables), encoding="utf-8")
    folder = tmp_path / "out"
    decent(call("study", study, "--workers", "1", "--out", folder), 0)
    decent(call("study", "show", folder), 0)
    decent(call("compare", folder), 0)
    decent(call("study", study, "--workers", "1", "--out", folder))
    decent(call("study", study, "--set", f"{text}={text}"), 2)
    decent(call("study", study, "--set", f"metrics=[{json.dumps(text)}]"), 2)
    decent(call("study", study, "--set", f"compare.axis={json.dumps(text)}"), 2)


ARGUMENTS = [
    ("run", "{}"), ("check", "{}"), ("graph", "{}"), ("explain", "{}"), ("cost", "{}"),
    ("components", "{}"), ("components", "{}:X"), ("components", "x:{}"), ("study", "{}"),
    ("study", "show", "{}"), ("compare", "{}", "{}"), ("{}",), ("run", "--{}"),
    ("run", SCENE, "--duration", "{}"), ("run", SCENE, "--seed", "{}"),
    ("run", SCENE, "--realtime", "{}"), ("check", SCENE, "--swap", "radar={}"),
    ("check", SCENE, "--swap", "{}=gate"), ("check", SCENE, "--swap", "{}"),
    ("check", SCENE, "--swap", "radar={}:X"), ("check", SCENE, "--set", "{}"),
    ("cost", SCENE, "--block", "{}"), ("cost", SCENE, "--against", "{}"),
    ("cost", SCENE, "--budget", "{}"), ("cost", "--map", "{}"),
    ("compare", SCENE, "--swap", "{}=gate"), ("compare", SCENE, "--swap", "gate={}"),
    ("run", SCENE, "--out", str(SCENE) + "/{}"), ("benchmark", "{}"), ("reproduce", "{}"),
    ("graph", SCENE, "--png", "--out", "/nowhere/{}"), ("study", "{}", "--executor", "{}"),
]  # fmt: skip


@pytest.mark.parametrize("arguments", ARGUMENTS, ids=lambda a: " ".join(map(str, a))[-60:])
def test_hostile_arguments(arguments: tuple[object, ...]) -> None:
    decent(call(*(str(word).replace("{}", SHORT) for word in arguments)), 2)


def test_hostile_file_names(tmp_path: Path) -> None:
    folder = tmp_path / "\x1b[31m\n\u202e[bold]$x^{$"
    folder.mkdir()
    path = folder / "\x9bscene.toml"
    path.write_text(f"extends = {json.dumps(str(SCENE))}\nduration_s = 2\n", encoding="utf-8")
    decent(call("check", path), 0)
    decent(call("run", path, "--out", folder / "o"), 0)
    decent(call("graph", path, "--png", "--out", folder / "g.png"), 0)
    path.write_text("extends = 5\nseed = -1\nnothing = 1", encoding="utf-8")
    decent(call("check", path), 2)


SECRET = "s3cr3t-of-somebody"
FOREIGN = {
    "passwd": f"root:{SECRET}:0:0:root:/root:/bin/bash\ndaemon:{SECRET}:1:1::/:/bin/sh\n",
    "key": f"-----BEGIN KEY-----\n{SECRET}\n-----END KEY-----\n",
    "environment": f"export TOKEN={SECRET}\n",
    "quoted": f'"{SECRET}" = "{SECRET}"\n"{SECRET}" = 1\n',
    "table twice": f"[{SECRET}]\n[{SECRET}]\n",
    "cut off": f'token = "{SECRET}',
    "list": f"{SECRET}\n" * 5,
    "control": f'a = "{SECRET}\x01"\n',
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_errors_do_not_repeat_a_file_that_is_no_scene(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "some.file"
    path.write_text(FOREIGN[kind])
    scene = tmp_path / "scene.toml"
    scene.write_text(f'extends = "{path}"\n')
    study = tmp_path / "study.toml"
    study.write_text(f'scene = "{path}"\nreplicas = 1\nmetrics = ["first_detection"]\n')
    traffic = ["--swap", "traffic=traffic.daa_file", "--set", f"blocks.traffic.file={path}"]
    other = [traffic[0], "traffic=traffic.csv", *traffic[2:]]
    for result in (
        *(call(command, path) for command in ("check", "run", "graph", "explain", "study")),
        call("check", scene), call("study", study), call("compare", path, path),
        call("check", SCENE, *traffic), call("check", SCENE, *other),
    ):  # fmt: skip
        decent(result, 2)
        assert SECRET not in result.output
        assert result.output.count("error: ") == 1


def test_progress_bars_show_titles_as_they_are() -> None:
    from rich.progress import Progress

    from dsa_des.terminal import terminal
    from dsa_des.terminal.safe_console import SafeConsole

    bar: Progress = terminal.progress_bar("text")
    stream = io.StringIO()
    bar.live.console = SafeConsole(file=stream, force_terminal=False, width=400)
    bar.add_task(HOSTILE, total=1, text=HOSTILE)
    bar.live.console.print(bar.get_renderable())
    assert not bad_letters(stream.getvalue()) and "[bold]" in stream.getvalue()
