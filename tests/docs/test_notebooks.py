"""The notebooks of the docs run from an empty folder and print what they hold."""

import json
import re

import pytest
from notebooks import NOTEBOOKS, cells_of, play

#: What a run says of the machine and not of the scene.
_SPEED = re.compile(r"[^>\n]*of CPU time[^<\n]*")


def html_of(output: dict) -> list[str]:
    """Return the lines of an output's HTML, if it has any."""
    return output.get("data", {}).get("text/html", [])


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_prints_what_it_holds(path, tmp_path, monkeypatch) -> None:
    """Where results changed on purpose, ``python tests/docs/notebooks.py`` makes them again."""
    cells = cells_of(json.loads(path.read_text(encoding="utf-8")))
    monkeypatch.chdir(tmp_path)
    held = [
        (
            "".join(line for out in cell["outputs"] for line in out.get("text", ())),
            _SPEED.sub("", "".join(line for out in cell["outputs"] for line in html_of(out))),
        )
        for cell in cells
    ]
    assert [(shown.text, _SPEED.sub("", shown.html)) for shown in play(cells)] == held
    assert list(tmp_path.iterdir()) == []


def test_there_is_a_tutorial_and_three_more_and_none_holds_a_path_of_its_maker() -> None:
    assert len(NOTEBOOKS) >= 4
    for path in NOTEBOOKS:
        text = path.read_text(encoding="utf-8")
        assert "/work" not in text and "/home" not in text and "/tmp" not in text
        assert len(text) < 400_000
