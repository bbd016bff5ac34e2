"""The list of faults fits the files; a fault is noticed, and what is none is not."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from faults import FAULTS
from faulty_copy import CAUGHT, OF_THE_LIST, ROOT, SURVIVED


def test_every_fault_fits_its_file():
    wrong = []
    for fault in FAULTS:
        try:
            assert fault.applied(ROOT) != (ROOT / fault.file).read_text(encoding="utf-8")
        except (ValueError, OSError) as error:
            wrong.append(str(error))
    assert not wrong


def test_every_fault_has_a_name_of_its_own_and_tests_that_exist():
    names = [fault.name for fault in FAULTS]
    assert len(set(names)) == len(names) >= 150
    files = {test.partition("::")[0] for fault in FAULTS for test in fault.tests}
    assert not [file for file in files if not (ROOT / file).is_file()]


#: Tries faults of one file, in a process that has not loaded the project.
TRY = """
import json, sys, tempfile, time
from pathlib import Path
from fault import Fault
from faulty_copy import ROOT, FaultyCopy, Trial
with tempfile.TemporaryDirectory() as folder:
    copy, found = FaultyCopy(Path(folder)), []
    for old, new in json.loads(sys.argv[1]):
        fault = Fault("wrapping", "none", sys.argv[2], old, new, (sys.argv[3],))
        trial = Trial(fault, copy)
        while (outcome := trial.outcome()) is None:
            time.sleep(0.02)
        assert (copy.folder / fault.file).read_bytes() == (ROOT / fault.file).read_bytes()
        found.append((outcome.result, outcome.by))
    assert not copy.folder.is_relative_to(ROOT)
print(json.dumps(found))
"""
FILE = "components/geometry/wrapping.py"
TESTS = "tests/geometry/test_angle_wrapping.py"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the tool needs os.fork")
def test_a_fault_is_noticed_and_what_changes_nothing_survives():
    """Of a fault, no fault and two texts that do not stand in the file once."""
    right = "TWO_PI = 2.0 * np.pi"
    before = (ROOT / FILE).read_bytes()
    tries = [
        (right, "TWO_PI = 2.1 * np.pi"), (right, "TWO_PI = np.pi * 2.0"),
        ("no such text", ""), ("TWO_PI", ""),
    ]  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", TRY, json.dumps(tries), FILE, TESTS],
        capture_output=True, text=True, check=True, timeout=600,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parent)},
    )  # fmt: skip
    fault, same, *texts = json.loads(done.stdout)
    assert fault[0] == CAUGHT and fault[1].startswith(TESTS)
    assert same == [SURVIVED, ""]
    assert [result for result, _ in texts] == [OF_THE_LIST] * 2
    assert (ROOT / FILE).read_bytes() == before
