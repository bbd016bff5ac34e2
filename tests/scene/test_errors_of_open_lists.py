"""A list of any length is told by its items and by the least that it must hold."""

import pytest

import dsa_des


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("'cv'", "models = 'cv': must be a list"),
        ("[]", "models = []: must be at least 2 values"),
        ("['turn']", "models = ['turn']: must be at least 2 values"),
        (
            "['velocity', 'turm']",
            "models[1] = 'turm': must be 'velocity', 'turn' or 'acceleration'; "
            "did you mean 'turn'?",
        ),
    ],
)
def test_one_problem_says_what_is_wrong_with_it(given: str, said: str) -> None:
    with pytest.raises(dsa_des.SceneError) as caught:
        dsa_des.load_scene(
            "first_light",
            sets=[
                "blocks.fusion.type='fusion.pass_through'",
                "blocks.tracker={type='tracking.imm'}",
                f"blocks.tracker.models={given}",
            ],
        )
    assert [str(problem).partition("blocks.tracker.")[2] for problem in caught.value.problems] == [
        said
    ]


def test_an_empty_name_is_refused_in_our_words() -> None:
    with pytest.raises(dsa_des.SceneError) as caught:
        dsa_des.load_scene("first_light", sets=["blocks.traffic.intruders[0].name=''"])
    (problem,) = caught.value.problems
    assert str(problem).endswith("blocks.traffic.intruders[0].name = '': must not be empty")
