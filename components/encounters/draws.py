"""Random numbers of encounters: a function of seed, purpose, encounter number and attempt.

Encounter 77,123 draws the same numbers alone and in any batch, and a longer track begins with the
shorter one. The generators are Philox4x64 and, for a few draws each, Philox4x32 (Salmon, Moraes,
Dror & Shaw, SC11), their keys made of seed and purpose, their counters of encounter and attempt;
many draws of one encounter are taken in sequence, which is ten times faster than a call for each.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from dsa_des.arrays.types import FloatArray, IntArray
from dsa_des.time.randomness import key_of, philox4x32

_BLOCK = 64
#: Numbers of encounters or attempts.
Ints = Sequence[int] | IntArray


class EncounterDraws:
    """Uniform numbers for one purpose.

    Parameters
    ----------
    seed : int
    purpose : str
    """

    def __init__(self, seed: int, purpose: str) -> None:
        self._key = np.array(
            [key_of(seed, "encounters", purpose), key_of(purpose, seed)], dtype=np.uint64
        )
        short = key_of(seed, "encounters", purpose, "few")
        self._short_key = (short & 0xFFFFFFFF, short >> 32)
        self._generator = np.random.Philox(key=0)
        self._numbers = np.random.Generator(self._generator)

    def few(self, numbers: Ints, count: int, attempts: Ints | int = 0) -> FloatArray:
        """Return draws as `uniform` does, others than those, faster where they are a handful."""
        number = np.asarray(numbers, dtype=np.uint64)
        attempt = np.asarray(attempts, dtype=np.uint64)
        blocks = np.arange((count + 1) // 2, dtype=np.uint64)[:, np.newaxis]
        low = np.uint64(0xFFFFFFFF)
        words = philox4x32(
            (blocks, attempt & low, number & low, number >> np.uint64(32)), self._short_key
        )
        pairs = ((words[0], words[1]), (words[2], words[3]))
        found = np.empty((2 * len(blocks), len(number)))
        for k, (high, rest) in enumerate(pairs):
            found[k::2] = ((high >> np.uint64(5)) * 67108864.0 + (rest >> np.uint64(6))) * 2.0**-53
        return found[:count]

    def uniform(self, numbers: Ints, count: int, attempts: Ints | int = 0) -> FloatArray:
        """Return draws in [0, 1) with 53 bits, shape (count, encounters).

        Parameters
        ----------
        numbers : sequence of int
            Encounters, from 0.
        count : int
            How many for each; fewer are the first ones of more.
        attempts : int or sequence of int
            How often an encounter was rejected before; one for each, or for all.
        """
        numbers = np.asarray(numbers).tolist()
        tries = np.broadcast_to(attempts, len(numbers)).tolist()
        counter = np.zeros(4, dtype=np.uint64)
        inner = {"counter": counter, "key": self._key}
        state: Any = {
            "bit_generator": "Philox", "state": inner, "buffer": np.zeros(4, dtype=np.uint64),
            "buffer_pos": 4, "has_uint32": 0, "uinteger": 0,
        }  # fmt: skip
        generator = self._generator
        found, drawn = np.empty((count, len(numbers))), np.empty((_BLOCK, count))
        # Turned in blocks that stay in the processor's cache.
        for start in range(0, len(numbers), _BLOCK):
            end = min(start + _BLOCK, len(numbers))
            for row in range(start, end):
                counter[1], counter[2] = numbers[row], tries[row]
                generator.state = state
                self._numbers.random(out=drawn[row - start])
            found[:, start:end] = drawn[: end - start].T
        return found
