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
    """A block with an instance for each stretch between timed changes; neighbours may share one.

    `from_ticks` are the first ticks of the stretches, ascending, the first one 0.
    """

    def __init__(self, from_ticks: IntArray, instances: Sequence[Component]) -> None:
        new = [n for n in range(len(instances)) if not n or instances[n] is not instances[n - 1]]
        self._from_ticks = from_ticks[new]
        self._instances = [instances[n] for n in new]
        self._now = 0

    @property
    def current_instance(self) -> Component:
        """The instance in force now, which holds the block's state."""
        return self._instances[self._now]

    @property
    def state_objects(self) -> list[object]:
        """All objects whose attributes hold the block's state, including this one."""
        each = {id(one): one for one in self._instances}.values()
        effects = [effect for one in each for effect in one.context.effects.values()]
        return [self, *each, *effects]

    def split_by_stretch(self, wake: Wake) -> Iterator[tuple[Component, Wake]]:
        """Yield (instance, part of the wake) for each stretch with instants, in order of time.

        What arrived comes with the rows of its stretch, or else with the next ones.
        """
        of = self._stretch_index(wake.ticks)
        stretches = np.unique(of)
        if len(stretches) == 1:
            yield self._switch_to_stretch(int(stretches[0])), wake
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
            yield (
                self._switch_to_stretch(stretch),
                wake.select_rows(np.flatnonzero(of == stretch), arrived),
            )

    def _arrivals_of_stretch(
        self, new: Arrivals, stretches: IntArray, place: int
    ) -> Arrivals | None:
        """Return the arrivals handed over with the rows of one stretch; None if there are none."""
        with_rows = np.searchsorted(stretches, self._stretch_index(new.tick))
        rows = np.flatnonzero(np.minimum(with_rows, len(stretches) - 1) == place)
        if len(rows) == 0:
            return None
        return Arrivals(new.source, new.instants.take(rows), new.message.take(rows))

    def _stretch_index(self, ticks: IntArray) -> IntArray:
        of: IntArray = np.searchsorted(self._from_ticks, ticks, side="right") - 1
        return of

    def _switch_to_stretch(self, stretch: int) -> Component:
        before, self._now = self.current_instance, stretch
        if self.current_instance is not before:
            self.current_instance.adopt_state(before)
        return self.current_instance
