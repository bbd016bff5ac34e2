"""The notebooks of the docs run from an empty folder and print what they hold."""

import ast
import io
import json
import re
from contextlib import redirect_stdout
from pathlib import Path

import pytest
from snippets import ROOT

NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.ipynb"))


#: What a run says of the machine and not of the scene.
_SPEED = re.compile(r"[^>\n]*of CPU time[^<\n]*")


def play(cells: list[dict], folder: Path) -> list[tuple[str, str]]:
    """Run cells as a notebook does; return what each prints, and its last value as HTML."""
    known: dict[str, object] = {"__name__": "__main__"}
    printed = []
    for number, cell in enumerate(cells):
        tree = ast.parse("".join(cell["source"]))
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        html = ""
        with redirect_stdout(io.StringIO()) as told:
            exec(compile(tree, f"cell {number}", "exec"), known)
            if last is not None:
                shown = eval(compile(ast.Expression(last.value), f"cell {number}", "eval"), known)
                kinds = ("_repr_html_", "_repr_png_")
                rich = [getattr(shown, kind)() for kind in kinds if hasattr(shown, kind)]
                assert any(rich) or not rich
                html = (rich[0] or "") if hasattr(shown, kinds[0]) else ""
        printed.append((told.getvalue(), _SPEED.sub("", html)))
    return printed


def html_of(output: dict) -> list[str]:
    """Return the lines of an output's HTML, if it has any."""
    return output.get("data", {}).get("text/html", [])


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_prints_what_it_holds(path, tmp_path, monkeypatch) -> None:
    book = json.loads(path.read_text(encoding="utf-8"))
    cells = [cell for cell in book["cells"] if cell["cell_type"] == "code"]
    monkeypatch.chdir(tmp_path)
    held = [
        (
            "".join(line for out in cell["outputs"] for line in out.get("text", ())),
            _SPEED.sub("", "".join(line for out in cell["outputs"] for line in html_of(out))),
        )
        for cell in cells
    ]
    assert play(cells, tmp_path) == held
    assert list(tmp_path.iterdir()) == []


def test_there_is_a_tutorial_and_three_more_and_none_holds_a_path_of_its_maker() -> None:
    assert len(NOTEBOOKS) >= 4
    for path in NOTEBOOKS:
        text = path.read_text(encoding="utf-8")
        assert "/work" not in text and "/home" not in text and "/tmp" not in text
        assert len(text) < 400_000
