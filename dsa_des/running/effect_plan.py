"""The effects that exist in a run: those the scene calls for, less those it tolerates."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dsa_des.block.component import Component
from dsa_des.block.effect import Effect, Verdict


@dataclass(frozen=True, eq=False)
class Planned:
    """What became of one effect of one block.

    Parameters
    ----------
    block : str
    effect : Effect
    verdict : Verdict
    built : bool
        Whether it exists in the run.
    because : str
        The reason, including that of a tolerance or of ``simulate_everything``.
    """

    block: str
    effect: Effect
    verdict: Verdict
    built: bool
    because: str

    def sentence(self) -> str:
        """Return, for example, ``rain: not simulated, [weather] rain_rate_mm_h is 0``."""
        return f"{self.effect.name}: {'' if self.built else 'not '}simulated, {self.because}"


def plan(
    block: Component, tolerance: Mapping[str, float], *, everything: bool = False
) -> list[Planned]:
    """Decide which of a block's effects are built.

    Parameters
    ----------
    block : Component
    tolerance : mapping
        ``[accuracy]`` of the scene: by quantity, how large an error is allowed. Effects are left
        out, smallest first, as long as the sum of their bounds stays within it.
    everything : bool
        Build every effect that can be parametrised neutrally.
    """
    verdicts = [(effect, effect.verdict(block)) for effect in type(block).effects]
    allowed = {} if everything else _within(verdicts, tolerance)
    planned = []
    for effect, verdict in verdicts:
        built, because = verdict.simulated, verdict.because
        if effect.name in allowed:
            built, because = False, allowed[effect.name]
        elif everything and not built and effect.neutral:
            built, because = True, f"though {verdict.because}: everything is simulated"
        planned.append(Planned(block.name, effect, verdict, built, because))
    return planned


def unspent(planned: Sequence[Planned], tolerance: Mapping[str, float]) -> dict[str, float]:
    """Return what is left of a tolerance after the bounds of all that it let go."""
    left = dict(tolerance)
    for item in planned:
        if item.verdict.simulated and not item.built:
            for quantity, bound in item.verdict.bound.items():
                left[quantity] -= bound
    return left


def _within(
    verdicts: Sequence[tuple[Effect, Verdict]], tolerance: Mapping[str, float]
) -> dict[str, str]:
    """Return the effects whose bounds together stay within the tolerance, and why each."""
    left = dict(tolerance)
    allowed: dict[str, str] = {}
    bounded = [
        (max(verdict.bound[q] / tolerance[q] for q in verdict.bound), effect, verdict)
        for effect, verdict in verdicts
        if verdict.simulated and verdict.bound and all(q in tolerance for q in verdict.bound)
    ]
    for _, effect, verdict in sorted(bounded, key=lambda item: (item[0], item[1].name)):
        if all(bound <= left[quantity] for quantity, bound in verdict.bound.items()):
            for quantity, bound in verdict.bound.items():
                left[quantity] -= bound
            parts = [
                f"its influence on {quantity} is at most {bound:.2g}, and [accuracy] allows "
                f"{tolerance[quantity]:g}"
                for quantity, bound in sorted(verdict.bound.items())
            ]
            allowed[effect.name] = "; ".join(parts)
    return allowed
