"""What the notebooks of the docs print; ``python tests/docs/notebooks.py`` writes it into them."""

import ast
import base64
import io
import json
import os
import tempfile
from contextlib import redirect_stdout
from pathlib import Path
from typing import NamedTuple

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs/notebooks").glob("*.ipynb"))


class Shown(NamedTuple):
    """What a cell prints, and its last value as HTML or as a picture."""

    text: str
    html: str
    png: bytes


def cells_of(book: dict) -> list[dict]:
    """Return the cells of a notebook that are run."""
    return [cell for cell in book["cells"] if cell["cell_type"] == "code"]


def play(cells: list[dict]) -> list[Shown]:
    """Run cells in the working directory, as a notebook does."""
    known: dict[str, object] = {"__name__": "__main__"}
    found = []
    for number, cell in enumerate(cells):
        tree = ast.parse("".join(cell["source"]))
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        html, png = "", b""
        with redirect_stdout(io.StringIO()) as printed:
            exec(compile(tree, f"cell {number}", "exec"), known)
            if last is not None:
                shown = eval(compile(ast.Expression(last.value), f"cell {number}", "eval"), known)
                html = shown._repr_html_() or "" if hasattr(shown, "_repr_html_") else ""
                png = shown._repr_png_() or b"" if hasattr(shown, "_repr_png_") else b""
                kinds = hasattr(shown, "_repr_html_") or hasattr(shown, "_repr_png_")
                assert html or png or not kinds
        found.append(Shown(printed.getvalue(), html, png))
    return found


def renewed(book: dict) -> str:
    """Return the text of a notebook with what its cells print today."""
    cells = cells_of(book)
    for cell, shown in zip(cells, play(cells), strict=True):
        for output in cell["outputs"]:
            data = output.get("data", {})
            if "text" in output:
                output["text"] = shown.text.splitlines(True)
            elif "text/html" in data:
                data["text/html"] = shown.html.splitlines(True)
            elif "image/png" in data:
                data["image/png"] = base64.b64encode(shown.png).decode()
    return json.dumps(book, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    for path in NOTEBOOKS:
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            text = renewed(json.loads(path.read_text(encoding="utf-8")))
        path.write_text(text, encoding="utf-8")
