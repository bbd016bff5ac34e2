"""A small fixed set of fuzzed input; ``run_many.py`` beside this file runs thousands."""

import sys

import pytest

if sys.platform == "win32":
    pytest.skip("cases are forked", allow_module_level=True)

from fuzz_cases import KINDS, Case, make_case
from fuzz_judge import judge

from dsa_des.scene.scene import load_scene
from tests.warm_server import build_models

EACH = 8


@pytest.fixture(scope="module", autouse=True)
def loaded(configs):
    """Do once what each case would do after it was forked."""
    load_scene(configs / "first_light.toml")
    build_models()


@pytest.mark.parametrize("number", range(EACH))
@pytest.mark.parametrize("kind", KINDS)
def test_bad_input_ends_in_one_message_or_a_run(kind, number):
    case = make_case(kind, 4, number)
    code, faults = judge(case)
    assert not faults, (case.argv, code, faults)


@pytest.mark.parametrize("kind", KINDS)
def test_a_case_is_a_function_of_its_name(kind):
    one, same, other = (make_case(kind, 4, number) for number in (3, 3, 4))
    assert one == same
    assert (one.files, one.argv) != (other.files, other.argv)


def test_the_judge_sees_a_sound_scene_end_well(configs):
    case = Case("sound", {}, ["simulate", str(configs / "first_light.toml"), "--duration", "1"])
    assert judge(case) == (0, [])


@pytest.mark.parametrize(
    ("code", "what"),
    [
        ("raise RuntimeError('lost')", "traceback"),
        ("import warnings; warnings.warn('odd', RuntimeWarning)", "warning"),
        ("print('\\x1b[2J')", "control character"),
        ("import os; os._exit(7)", "exit code 7"),
        ("import sys; open('half', 'w'); sys.exit(2)", "left ['half']"),
        ("while True: pass", "hang"),
    ],
)
def test_the_judge_sees_what_is_wrong(monkeypatch, code, what):
    import fuzz_judge

    monkeypatch.setattr(fuzz_judge, "_call", lambda argv: exec(code, {}) or 0)
    _, faults = judge(Case("bad", {}, ["check"]), limit_s=1.0)
    assert any(fault.startswith(what) for fault in faults), faults
