"""docs/numerics.md says what the code computes, and what it computes is true."""

import functools
import importlib
import math
import subprocess
import sys

import pytest

from docs.make import numerics as document
from docs.make.numerics import PAGE, SECTIONS, differences, main, markdown


def test_the_page_is_up_to_date(capsys):
    assert main(["--check"]) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("section", range(len(SECTIONS)), ids=[name for name, _ in SECTIONS])
def test_ours_is_the_reference_and_the_naive_result_is_not(section):
    for case in SECTIONS[section][1]():
        assert case.text(case.ours) == case.text(case.reference), case.what
        assert case.text(case.naive) != case.text(case.reference), case.what
        # Digits are shown only as far as they are sure, whatever the machine's library.
        if case.ours and math.isfinite(case.ours):
            within = 10.0 ** -(case.digits + 1) * abs(case.ours)
            assert abs(case.ours - case.reference) <= within, case.what


def test_a_page_that_differs_is_found(tmp_path, capsys, monkeypatch):
    once = [(name, functools.cache(cases)) for name, cases in SECTIONS]
    monkeypatch.setattr(document, "SECTIONS", once)
    page = PAGE.read_text(encoding="utf-8")
    assert differences(page) == []
    broken = page.replace("| 36000 | 36000 |", "| 35999 | 36000 |")
    broken = broken.replace("| 108 | 108 |", "| 108 | 108.5 |")
    lines = [line for line in broken.splitlines() if "12 m² at range 0" not in line]
    lines.append("| a case of yesterday | x | 1 | 2 | 2 | y |")
    path = tmp_path / "page.md"
    path.write_text("\n".join(lines), encoding="utf-8")
    assert main(["--check", "--page", str(path)]) == 1
    out = capsys.readouterr().out
    assert "the page has 35999 (reference 36000), computed is 36000" in out
    assert "reference 108.5" in out
    assert "12 m² at range 0: pixels covered: is not on the page" in out
    assert "a case of yesterday: is on the page only" in out
    assert len(out.splitlines()) == 4
    # What the naive column holds is noise and may differ.
    noisy = page.replace("0.00100124949961", "0.00100124949962")
    assert noisy != page and differences(noisy) == []
    assert main(["--check", "--page", str(tmp_path / "none.md")]) == 2


def test_without_mpmath_it_says_what_to_install(monkeypatch, capsys):
    real = importlib.import_module

    def blocked(name, *rest):
        if name == "mpmath":
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(importlib, "import_module", blocked)
    assert main(["--check"]) == 2
    assert "pip install mpmath" in capsys.readouterr().err


def test_the_command_prints_the_page():
    command = [sys.executable, "-W", "error", "-m", "docs.make.numerics"]
    done = subprocess.run(command, capture_output=True, check=True, encoding="utf-8")
    assert done.stdout == markdown()
    assert done.stderr == ""
