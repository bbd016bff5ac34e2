"""An exception inside a block says which block, when, and at which scan."""

from pathlib import Path

import engine_blocks as blocks
import pytest

from dsa_des.errors import BlockFailure, SceneError


def failure(lab, cells, wires, **options):
    with pytest.raises(BlockFailure) as caught:
        lab.run(lab.write(cells, wires, duration_s=3), **options)
    return caught.value


@pytest.mark.parametrize("window", [1, 2, 7, None])
@pytest.mark.parametrize("kind", ["Faulty", "FaultyWindowed"])
def test_failing_in_run_names_the_block_the_time_and_the_scan(lab, kind, window):
    cells = {"radar": f"{kind}; scan_rate_hz = 10", "end": "Relay"}
    error = failure(lab, cells, ['"radar -> end"'], window=window)
    said, _, place = str(error).partition(" (/")
    assert said == (
        f"radar (engine_blocks:{kind}) failed at t = 1.200 s, scan 12: "
        "ValueError: the antenna fell off"
    )
    line, _, name = place.removesuffix(")").rpartition(", in ")
    file, _, number = line.rpartition(", line ")
    assert Path(blocks.__file__) == Path(f"/{file}") and name == "_raise"
    text = Path(blocks.__file__).read_text(encoding="utf-8").splitlines()[int(number) - 1]
    assert "raise ValueError" in text
    assert isinstance(error.__cause__, ValueError)
    assert (error.block, error.scan, error.time_s) == ("radar", 12, 1.2)


@pytest.mark.parametrize("window", [1, 3, None])
def test_the_first_failure_in_time_is_the_one_reported(lab, window):
    cells = {
        "a": "FaultyWindowed; scan_rate_hz = 10; at_scan = 25",
        "b": "FaultyWindowed; scan_rate_hz = 5; at_scan = 3; how = 'zero'",
        "end": "Join",
    }
    error = failure(lab, cells, ['"a -> end"', '"b -> end"'], window=window)
    assert str(error).startswith(
        "b (engine_blocks:FaultyWindowed) failed at t = 0.600 s, scan 3: Zero"
    )


def test_an_exception_with_keyword_arguments_survives(lab):
    for kind in ("Faulty", "FaultyWindowed"):
        cells = {"radar": f"{kind}; scan_rate_hz = 10; how = 'keyword'", "end": "Relay"}
        error = failure(lab, cells, ['"radar -> end"'])
        assert "failed at t = 1.200 s, scan 12: KeywordOnly: code 7 (/" in str(error)
        assert isinstance(error.__cause__, blocks.KeywordOnly)
        assert error.__cause__.code == 7


@pytest.mark.parametrize("how", ["value", "keyword", "zero"])
def test_failing_in_a_process_of_its_own(lab, how):
    cells = {"radar": f"FaultyProcess; scan_rate_hz = 10; how = '{how}'", "end": "Relay"}
    error = failure(lab, cells, ['"radar -> end"'])
    assert str(error).startswith("radar (engine_blocks:FaultyProcess) failed at t = 1.200 s: ")
    assert error.scan is None
    assert error.__cause__ is not None


def test_a_block_that_refuses_its_parameters_is_a_problem_of_the_scene(lab):
    for kind, reason in [
        ("FaultySetup", "the antenna fell off"),
        ("FaultyInit", "no such antenna"),
    ]:
        cells = {"radar": f"{kind}; scan_rate_hz = 10", "end": "Relay"}
        path = lab.write(cells, ['"radar -> end"'])
        with pytest.raises(SceneError) as caught:
            lab.run(path)
        assert str(caught.value) == f"{path}: blocks.radar: {reason}"


def test_a_block_that_breaks_in_setup_is_a_block_failure(lab):
    cells = {"radar": "FaultySetup; scan_rate_hz = 10; how = 'keyword'", "end": "Relay"}
    error = failure(lab, cells, ['"radar -> end"'])
    assert str(error) == (
        "radar (engine_blocks:FaultySetup) failed at t = 0.000 s: KeywordOnly: code 7"
    )
    assert isinstance(error.__cause__, blocks.KeywordOnly)


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ("type", "output 'out' is declared to send Beat, not Note"),
        ("port", "returned a message for 'nowhere', which is not one of its outputs"),
        ("future", "they must be int64 and lie in the instants it ran at"),
        ("float", "of type float64; they must be int64"),
    ],
)
def test_what_must_not_be_sent(lab, how, reason):
    cells = {"radar": f"Sender; scan_rate_hz = 10; how = '{how}'", "end": "Relay"}
    error = failure(lab, cells, ['"radar -> end"'])
    assert str(error).startswith("radar (engine_blocks:Sender) failed at t = 0.000 s, scan 0: ")
    assert reason in str(error)


def test_a_lone_message_from_a_block_with_two_outputs(lab):
    cells = {"radar": "ManyFaults; scan_rate_hz = 10", "end": "Relay"}
    error = failure(lab, cells, ['"radar.left -> end.in"'])
    assert "returned one message but has 2 outputs; return a dict of left, right" in str(error)
