"""The example of ``docs/embedding.md`` runs as it is printed."""

import re
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "embedding.md"


def test_the_example_runs(monkeypatch, capsys):
    monkeypatch.chdir(PAGE.parents[1])
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    names = {}
    exec(compile(code, str(PAGE), "exec"), names)
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) == len(names["first_seen"]) == 2
    assert set(names["first_seen"]) == {"fighter", "glider"}
    # The fighter comes straight at us, and large as it is, it is seen from farther away.
    assert "fighter at azimuth 0.0 deg" in "".join(printed)
    assert names["first_seen"]["fighter"] < names["first_seen"]["glider"]
