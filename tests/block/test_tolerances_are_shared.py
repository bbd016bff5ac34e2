"""Effects that are left out share what the scene allows: the cheapest go first."""

from types import SimpleNamespace

import pytest

from dsa_des.block.effect import Effect, Verdict
from dsa_des.running.effects import plan_effects, remaining_tolerance


class _Bounded(Effect):
    def __init__(self, name: str, *, simulated: bool = True, **bound: float) -> None:
        self.name = name  # type: ignore[misc]
        self.found = Verdict(simulated, "because", bound)

    def verdict(self, block: object) -> Verdict:
        return self.found


def block(*effects: Effect) -> object:
    return type("Block", (SimpleNamespace,), {"effects": effects})(name="block")


def left_out(planned: list) -> set[str]:
    return {item.effect.name for item in planned if item.verdict.simulated and not item.built}


FOUR = (
    _Bounded("large", pd=0.06),
    _Bounded("small", pd=0.02),
    _Bounded("middle", pd=0.03),
    _Bounded("endless"),
    _Bounded("not called for", simulated=False, pd=0.01),
)


@pytest.mark.parametrize(
    ("allowed", "names"),
    [
        (0.0199, set()), (0.02, {"small"}), (0.049, {"small"}), (0.05, {"small", "middle"}),
        (0.109, {"small", "middle"}), (0.11, {"small", "middle", "large"}),
    ],
)  # fmt: skip
def test_bounds_together_stay_within_the_tolerance(allowed, names):
    """An allowance that two bounds fill exactly is one for the two."""
    planned = plan_effects(block(*FOUR), {"pd": allowed + 1e-12})
    assert left_out(planned) == names
    spent = sum({"large": 0.06, "small": 0.02, "middle": 0.03}[name] for name in names)
    left = remaining_tolerance(planned, {"pd": allowed, "angle": 1.0})
    assert left == {"pd": pytest.approx(allowed - spent), "angle": 1.0}


def test_a_bound_of_two_quantities_needs_both():
    both = block(_Bounded("both", pd=0.01, angle=0.1))
    assert not left_out(plan_effects(both, {"pd": 0.02}))
    assert not left_out(plan_effects(both, {"pd": 0.02, "angle": 0.05}))
    assert left_out(plan_effects(both, {"pd": 0.02, "angle": 0.2})) == {"both"}


def test_without_a_tolerance_or_with_everything_none_is_left_out():
    assert not left_out(plan_effects(block(*FOUR), {}))
    planned = plan_effects(block(*FOUR), {"pd": 0.5}, everything=True)
    assert all(item.built for item in planned)
