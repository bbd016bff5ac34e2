"""The lists of faults fit the project; a fault is noticed, and what is none is not."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from definitions import ROOT, definition, parsed, replaced
from fault import FAULTS, Fault, read, test_named
from faulty_copy import CAUGHT, OF_THE_LIST, SURVIVED


def test_every_fault_fits_its_file():
    wrong = []
    for fault in FAULTS:
        try:
            fault.applied()
        except ValueError as error:
            wrong.append(str(error))
    assert not wrong


def test_every_fault_has_a_name_of_its_own_and_tests_that_exist():
    names = [fault.name for fault in FAULTS]
    assert len(set(names)) == len(names) >= 150
    wrong = []
    for test in sorted({test for fault in FAULTS for test in fault.near}):
        file, _, inner = test.partition("::")
        try:
            text = (ROOT / test_named(file)).read_text(encoding="utf-8")
            if f"def {inner}(" not in text and inner:
                wrong.append(f"{test} is not in its file")
        except ValueError as error:
            wrong.append(str(error))
    assert not wrong


def test_a_definition_is_found_by_its_name_and_one_of_several_by_its_module():
    assert definition("angles.TWO_PI").file == FILE
    with pytest.raises(ValueError, match="no_such_function is defined nowhere"):
        definition("no_such_function")
    with pytest.raises(
        ValueError, match=r"ambiguous; say which: .*Camera.look, .*SwerlingRadar.look"
    ):
        definition("look")


def test_layout_of_code_counts_for_nothing_and_only_its_place_changes():
    where, before = definition("angles.wrap_pi"), (ROOT / FILE).read_text(encoding="utf-8")
    body = where.nodes[0].body[1:]
    last = ast.unparse(body[-1])
    laid_out = parsed(f"{last}  # says why", statements=True)
    after = replaced(where, laid_out, parsed("pass", statements=True))
    assert before.count("pass\n") + 1 == after.count("pass\n")
    assert len(ast.parse(after).body) == len(ast.parse(before).body)
    with pytest.raises(ValueError, match="holds 0 times: no_such_name"):
        replaced(where, parsed("no_such_name"), parsed("1"))


def test_a_list_is_read_and_what_is_none_is_an_error():
    text = """# Kinds.

Gauge.height: test_one far/test_two::test_a
    up-for-down: -z
        → (z +
           0)
    loop:
            for a in b:
                c(a)
        →
            c(b)
        = c takes
        = both
ZERO: test_one
    one: 0 → 1
"""
    two = ("test_one", "far/test_two::test_a")
    loop = ("for a in b:\n    c(a)", "c(b)")
    assert list(read(text, "kinds")) == [
        Fault("up-for-down", "kinds", "Gauge.height", "-z", "(z +\n          0)", two),
        Fault("loop", "kinds", "Gauge.height", *loop, two, "c takes both"),
        Fault("one", "kinds", "ZERO", "0", "1", ("test_one",)),
    ]
    for wrong in ("no colon", "A: t\n    name: 0", "    name: 0 → 1", "A: t\n  b: 0 → 1"):
        with pytest.raises(ValueError, match="kinds"):
            list(read(wrong, "kinds"))


def test_a_test_is_named_without_its_folder():
    assert test_named("test_faults_fit::test_x") == "tests/mutation/test_faults_fit.py::test_x"
    with pytest.raises(ValueError, match="the test test_no_such_thing does not exist"):
        test_named("test_no_such_thing")
    with pytest.raises(ValueError, match=r"ambiguous; say which: .*, tests/"):
        test_named("test_in_a_browser")


#: Tries faults of one constant, in a process that has not loaded the project.
TRY = """
import json, sys, tempfile, time
from pathlib import Path
from fault import Fault
from faulty_copy import ROOT, FaultyCopy, Trial
with tempfile.TemporaryDirectory() as folder:
    copy, found = FaultyCopy(Path(folder)), []
    for old, new in json.loads(sys.argv[1]):
        fault = Fault("wrapping", "none", "angles.TWO_PI", old, new, (sys.argv[2],))
        trial = Trial(fault, copy)
        while (outcome := trial.outcome()) is None:
            time.sleep(0.02)
        assert (copy.folder / fault.file).read_bytes() == (ROOT / fault.file).read_bytes()
        found.append((outcome.result, outcome.by))
    assert not copy.folder.is_relative_to(ROOT)
print(json.dumps(found))
"""
FILE = "components/geometry/angles.py"
TESTS = "test_angle_wrapping"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the tool needs os.fork")
def test_a_fault_is_noticed_and_what_changes_nothing_survives():
    """Of a fault, no fault and codes that do not stand there, or change nothing."""
    right = "TWO_PI = 2.0 * np.pi"
    before = (ROOT / FILE).read_bytes()
    tries = [
        (right, "TWO_PI = 2.1 * np.pi"), ("2.0 * np.pi", "np.pi * 2.0"),
        ("no_such_code", "0"), (right, "TWO_PI = (2.0 * np.pi)"),
    ]  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", TRY, json.dumps(tries), TESTS],
        capture_output=True, text=True, check=True, timeout=600,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parent)},
    )  # fmt: skip
    fault, same, *texts = json.loads(done.stdout)
    assert fault[0] == CAUGHT and fault[1].startswith(test_named(TESTS))
    assert same == [SURVIVED, ""]
    assert [result for result, _ in texts] == [OF_THE_LIST] * 2
    assert (ROOT / FILE).read_bytes() == before
