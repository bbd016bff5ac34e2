"""A block whose parameters change while it runs, as if it were one block.

What it is under the parameters of each stretch of time is an instance, set up as a scene of that
stretch would set it up. A row is handled by the instance of the stretch that it lies in; what the
block remembers goes on from one to the next (`Component.adopt_state`).
"""

from collections.abc import Iterator, Sequence

import numpy as np

from dsa_des.arrays.types import IntArray
from dsa_des.block.component import Component
from dsa_des.block.wake import Arrivals, Wake


class StretchedBlock:
    """The instances of a block, one for each stretch; neighbouring stretches may share theirs.

    `from_ticks` are the first ticks of the stretches, ascending, the first one 0.
    """

    def __init__(self, from_ticks: IntArray, instances: Sequence[Component]) -> None:
        new = [n for n in range(len(instances)) if not n or instances[n] is not instances[n - 1]]
        self._from_ticks = from_ticks[new]
        self._instances = [instances[n] for n in new]
        self._now = 0

    @property
    def now(self) -> Component:
        """The instance that holds what the block remembers."""
        return self._instances[self._now]

    @property
    def state_objects(self) -> list[object]:
        """All objects whose attributes hold the state of the block, this one among them."""
        each = {id(one): one for one in self._instances}.values()
        effects = [effect for one in each for effect in one.context.effects.values()]
        return [self, *each, *effects]

    def parts(self, wake: Wake) -> Iterator[tuple[Component, Wake]]:
        """Yield the rows of each stretch in turn, and the instance that handles them then.

        What arrived comes with the rows of its stretch, or else with the next ones.
        """
        of = self._stretch_of(wake.ticks)
        stretches = np.unique(of)
        if len(stretches) == 1:
            yield self._go_to(int(stretches[0])), wake
            return
        for place, stretch in enumerate(stretches.tolist()):
            arrived = {
                port: [
                    part
                    for new in every
                    if (part := self._arrivals_of_stretch(new, stretches, place))
                ]
                for port, every in wake._arrived.items()
            }
            yield self._go_to(stretch), wake.part(np.flatnonzero(of == stretch), arrived)

    def _arrivals_of_stretch(
        self, new: Arrivals, stretches: IntArray, place: int
    ) -> Arrivals | None:
        """Return what of some arrivals comes with the rows of one of the stretches."""
        with_rows = np.searchsorted(stretches, self._stretch_of(new.tick))
        rows = np.flatnonzero(np.minimum(with_rows, len(stretches) - 1) == place)
        if len(rows) == 0:
            return None
        return Arrivals(new.source, new.instants.take(rows), new.message.take(rows))

    def _stretch_of(self, ticks: IntArray) -> IntArray:
        of: IntArray = np.searchsorted(self._from_ticks, ticks, side="right") - 1
        return of

    def _go_to(self, stretch: int) -> Component:
        before, self._now = self.now, stretch
        if self.now is not before:
            self.now.adopt_state(before)
        return self.now
