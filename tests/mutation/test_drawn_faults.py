"""Mistakes are found in a syntax tree, written in their place, and known by where they are."""

import ast
import json
import random

from drawn_fault import faults_of
from fault_page import table_of_rooms, with_random
from faulty_copy import CAUGHT, ROOT, SURVIVED
from random_faults import equivalents

TEXT = '''"""Text with 1 number."""
import math
LIMIT = 2.5
class Beam:
    """Declared."""
    width: float = 3.0
    def gain(self, a: int = 7, *, far=False) -> "1.0":
        zip(a, far, strict=True)
        if a < LIMIT and not far:
            raise ValueError(f"{a + 1}")
        return f"{a - self.width:.1f}" + str(min(a, 4, key=abs)) if far else math.sin(-a)
'''

FOUND = """
::constant 2.5>2.75 2.5>5.0
Beam.gain::off by one 7>8 7>6 4>5 4>3
Beam.gain::true or false False>True
Beam.gain::swapped branches a < LIMIT and (not far)>not (a < LIMIT and (not far))
Beam.gain::and, or a < LIMIT and (not far)>a < LIMIT or not far
Beam.gain::dropped condition a < LIMIT and (not far)>not far a < LIMIT and (not far)>a < LIMIT
Beam.gain::comparison a < LIMIT>a <= LIMIT a < LIMIT>a >= LIMIT
Beam.gain::dropped not not far>far
Beam.gain::arithmetic a - self.width>a + self.width
Beam.gain::dropped term a - self.width>a
Beam.gain::swapped operands a - self.width>self.width - a
Beam.gain::dropped statement zip(a, far, strict=True)>pass
Beam.gain::swapped arguments min(a, 4, key=abs)>min(4, a, key=abs)
Beam.gain::dropped keyword min(a, 4, key=abs)>min(a, 4)
Beam.gain::another function min(a, 4, key=abs)>max(a, 4, key=abs) math.sin(-a)>math.cos(-a)
Beam.gain::sign -a>a
"""


def test_every_mistake_is_found_and_nothing_that_is_declared_or_said():
    kinds: dict[str, list[str]] = {}
    for fault in faults_of("a/b/c.py", TEXT):
        change = fault.change.replace("  →  ", ">")
        kinds.setdefault(f"{fault.where}::{fault.operator}", []).append(change)
    assert len(kinds["Beam.gain::swapped branches"].pop().split(">")) == 2
    assert (
        kinds["Beam.gain::swapped arguments"].pop(0).startswith("zip(a, far, strict=True)>zip(far")
    )
    said = {f"{kind} {' '.join(changes)}" for kind, changes in kinds.items()}
    assert said == set(FOUND.strip().splitlines())


def test_what_means_the_same_is_no_mistake():
    text = "max(2, b)\nnp.minimum(a, b, out=c); np.add(a, b); known.add(a, b)\nmax(2, b, key=f)\n"
    text += "json.dumps(a, ensure_ascii=True)\n"
    text += "np.zeros(n, dtype=np.float64)\nnp.zeros(n, dtype=int)\nnp.fromiter(a, int, count=n)\n"
    found = [f for f in faults_of("a/b.py", text) if f.operator.endswith(("arguments", "keyword"))]
    assert [(f.line, f.change.partition("  →  ")[2]) for f in found] == [
        (2, "np.minimum(a, b)"), (2, "known.add(b, a)"), (3, "max(b, 2, key=f)"),
        (3, "max(2, b)"), (6, "np.zeros(n)"),
        (7, "np.fromiter(int, a, count=n)"),
    ]  # fmt: skip


def test_a_mistake_changes_its_place_alone():
    for fault in faults_of("a/b/c.py", TEXT):
        tree = ast.parse(fault.applied())
        assert ast.dump(tree) != ast.dump(ast.parse(TEXT))
        changed = [
            number
            for number, (old, new) in enumerate(
                zip(TEXT.splitlines(), fault.applied().splitlines(), strict=True), 1
            )
            if old != new
        ]
        assert changed == [fault.line]
        assert fault.room == "a/b"


def test_mistakes_of_the_project_can_be_written():
    dice = random.Random(5)
    files = sorted((ROOT / "components").rglob("*.py")) + sorted((ROOT / "dsa_des").rglob("*.py"))
    for path in dice.sample(files, 6):
        text = path.read_text(encoding="utf-8")
        found = faults_of(path.relative_to(ROOT).as_posix(), text)
        assert len({fault.digest for fault in found}) == len(found)
        for fault in dice.sample(found, min(3, len(found))):
            assert fault.applied() != text


def test_what_is_called_equivalent_is_there():
    """In whatever file: a name begins with where it stood when it was found."""
    rows = json.loads((ROOT / "tests/mutation/equivalent.json").read_text(encoding="utf-8"))
    marked = equivalents()
    assert len(marked) == len(rows) and all(row["reason"] for row in rows)
    places = {row["name"].split("::")[1].rpartition(".")[2] for row in rows}
    known: set[str] = set()
    for path in (p for room in ("dsa_des", "components") for p in (ROOT / room).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if any(f"def {place}(" in text or f"class {place}" in text for place in places):
            known |= {fault.digest for fault in faults_of(str(path.relative_to(ROOT)), text)}
    assert marked.keys() <= known


def test_shares_are_of_those_that_can_be_noticed(tmp_path):
    def row(room: str, result: str, equivalent: str = "") -> dict:
        return {
            "room": room, "result": result, "equivalent": equivalent, "seed": 4, "at": "2026-01-02",
            "place": f"{room}/x.py:7", "operator": "sign", "change": "-x  →  x",
        }  # fmt: skip

    rows = [row("b", CAUGHT)] * 8 + [row("b", SURVIVED)] * 2 + [row("a", SURVIVED, "none")]
    # By Wilson, of 8 in 10: 0.4902 to 0.9433 (Brown, Cai and DasGupta's formula, by hand).
    assert "| b | 10 | 0 | 8 | 2 | 80 % | 49 % | 94 % |" in table_of_rooms(rows)
    assert "| a | 1 | 1 | 0 | 0 | nan % | 0 % | 100 % |" in table_of_rooms(rows)
    page = tmp_path / "page.md"
    page.write_text("# First\n\nlist\n", encoding="utf-8")
    for _ in range(2):
        page.write_text(with_random(page, rows), encoding="utf-8")
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# First\n\nlist\n") and text.count("## Drawn at random") == 1
    assert text.count("`b/x.py:7`") == 2 and "`a/x.py:7`" not in text
    assert "Seed 4, 2026-01-02" in text
