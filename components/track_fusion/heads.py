"""What a fusion of tracks keeps of every replica beside its tracks."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from components.track_fusion.local_tracks import LocalTracks
from dsa_des.arrays.types import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class FusionHeads:
    """What is kept of each replica beside its tracks, replicas ascending.

    Parameters
    ----------
    replica : (n,)
    origin : (3, n)
        Of its frame (latitude, longitude in deg, height in m); NaN before the first track.
    next_number : (n,)
    time_s : (n,)
        The newest instant that any track spoke of.
    own_m : (3, n)
        Where in the frame the ownship was then.
    """

    replica: IntArray
    origin: FloatArray
    next_number: IntArray
    time_s: FloatArray
    own_m: FloatArray

    def take(self, which: Any) -> "FusionHeads":
        """Return those of some replicas."""
        return FusionHeads(
            self.replica[which], self.origin[:, which], self.next_number[which],
            self.time_s[which], self.own_m[:, which],
        )  # fmt: skip

    def kept_with(self, newer: "FusionHeads") -> "FusionHeads":
        """Return those of all replicas, as they are in `newer` where they are among them."""
        old = self.take(~np.isin(self.replica, newer.replica))
        names = [field.name for field in fields(self)]
        both = (np.concatenate([getattr(h, n) for h in (old, newer)], axis=-1) for n in names)
        whole = FusionHeads(*both)
        return whole.take(np.argsort(whole.replica, kind="stable"))


def later_heads(heads: FusionHeads, new: LocalTracks) -> FusionHeads:
    """Return heads that know the newest instant, and where the ownship is then."""
    time_s, own_m = heads.time_s.copy(), heads.own_m.copy()
    order = np.lexsort((-new.tracker, new.time_s))
    of = np.searchsorted(heads.replica, new.replica[order])
    late = new.time_s[order] >= time_s[of]
    time_s[of[late]] = new.time_s[order][late]
    own_m[:, of[late]] = new.own_m[:, order][:, late]
    return replace(heads, time_s=time_s, own_m=own_m)
