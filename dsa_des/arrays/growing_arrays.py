"""Arrays that grow at their end again and again, each state of which stays as it was."""

from __future__ import annotations

from copy import copy
from typing import Any, Self

import numpy as np

from dsa_des.arrays.types import AnyArray


class GrowingArray:
    """An array (..., n) with room for more at its end.

    What has more of it shares its memory, so that adding n times moves each value a few times and
    not n times. Two that grew out of one do not see each other's: the second one moves.
    """

    def __init__(
        self, values: AnyArray, room: AnyArray | None = None, taken: list[int] | None = None
    ) -> None:
        self.values = values
        self._room = values if room is None else room
        #: How much of the room is taken by the longest that shares it.
        self._taken = [values.shape[-1]] if taken is None else taken

    def with_appended(self, values: AnyArray) -> GrowingArray:
        """Return an array with more values at its end."""
        begin = self.values.shape[-1]
        end = begin + values.shape[-1]
        room, taken = self._room, self._taken
        if taken[0] != begin or end > room.shape[-1]:
            room, taken = np.empty_like(room, shape=(*room.shape[:-1], 2 * end)), [begin]
            room[..., :begin] = self.values
        room[..., begin:end] = values
        taken[0] = end
        return GrowingArray(room[..., :end], room, taken)


class Growing:
    """What holds such arrays as attributes."""

    def with_appended(self, **more: AnyArray) -> Self:
        """Return a copy in which the given values are appended to the arrays of these names."""
        rooms: dict[str, Any] = dict(self.__dict__.get("_rooms", {}))
        longer = copy(self)
        for name, values in more.items():
            room = rooms.get(name) or GrowingArray(getattr(self, name))
            rooms[name] = room.with_appended(values)
            longer.__dict__[name] = rooms[name].values
        longer.__dict__["_rooms"] = rooms
        return longer
