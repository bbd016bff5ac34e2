"""Keyed random numbers: a draw is a function of its key and of nothing else.

The key is (seed, block, purpose, target, scan, draw number), hashed into the key and counter of
Philox4x32-10 (Salmon, Moraes, Dror & Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11).
Leaving out a scan, adding a target, swapping another block or changing the window therefore moves
no other block's draws.

A run *branches* by its seed: up to an instant it draws as the run that it comes from, and so is
that run, and from then on by a seed of its own (`BranchedSeed`). No block's memory is copied.
"""

from collections.abc import Callable, Sequence
from functools import cached_property
from hashlib import blake2b
from typing import Any

import numpy as np
import numpy.typing as npt

from dsa_des.arrays.types import FloatArray, IntArray

UInt32Array = npt.NDArray[np.uint32]
UInt64Array = npt.NDArray[np.uint64]

_M0, _M1 = 0xD2511F53, 0xCD9E8D57
_LOW = 0xFFFFFFFF
#: What each of the ten rounds adds to the key.
_BUMPS = [(n * 0x9E3779B9 & _LOW, n * 0xBB67AE85 & _LOW) for n in range(10)]
_U_LOW, _U32 = np.uint64(_LOW), np.uint64(32)

# Up to this many draws Python's integers take less time than the calls of NumPy do.
_FEW = 12


def philox4x32(
    counter: tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike, npt.ArrayLike],
    key: tuple[npt.ArrayLike, npt.ArrayLike],
) -> tuple[UInt64Array, UInt64Array, UInt64Array, UInt64Array]:
    """Return the four 32-bit words of Philox4x32-10, vectorised over broadcast arrays.

    Parameters
    ----------
    counter : four arrays of integers in [0, 2^32)
    key : two arrays of integers in [0, 2^32)

    Returns
    -------
    four uint64 arrays holding 32-bit words

    Notes
    -----
    Checked against the known-answer vectors published with the Random123 library.
    """
    x0, x1, x2, x3 = (np.asarray(word, dtype=np.uint64) for word in counter)
    k0, k1 = (np.asarray(word, dtype=np.uint64) for word in key)
    keys = [
        ((k0 + np.uint64(first)) & _U_LOW, (k1 + np.uint64(second)) & _U_LOW)
        for first, second in _BUMPS
    ]
    return _philox_of_arrays((x0, x1, x2, x3), keys)


def _philox_of_arrays(counter: Any, keys: Any) -> Any:
    x0, x1, x2, x3 = counter
    return _ten_rounds(x0, x1, x2, x3, keys, np.uint64(_M0), np.uint64(_M1), _U_LOW, _U32)


def _ten_rounds(
    x0: Any, x1: Any, x2: Any, x3: Any, keys: Any,
    m0: Any = _M0, m1: Any = _M1, low: Any = _LOW, half: Any = 32,
) -> Any:  # fmt: skip
    """Return four words after ten Philox rounds, a key each, for uint64 arrays or integers."""
    for k0, k1 in keys:
        product0 = x0 * m0
        product1 = x2 * m1
        x0, x1, x2, x3 = (
            (product1 >> half) ^ x1 ^ k0,
            product1 & low,
            (product0 >> half) ^ x3 ^ k1,
            product0 & low,
        )
    return x0, x1, x2, x3


def key_of(*parts: object) -> int:
    """Return a 64-bit hash of the given parts as a key, equal for equal parts on every machine."""
    text = "\x1f".join(f"{type(part).__name__}:{part}" for part in parts)
    return int.from_bytes(blake2b(text.encode(), digest_size=8).digest(), "little")


def target_keys(names: tuple[str, ...]) -> UInt64Array:
    """Return the 64-bit keys of targets by their names, shape (targets,), for random draws."""
    # As `key_of("target", name)`, which takes three times as long for each of a million names.
    texts = ("str:target\x1fstr:" + name for name in names)
    digests = b"".join(blake2b(text.encode(), digest_size=8).digest() for text in texts)
    return np.frombuffer(digests, dtype="<u8").astype(np.uint64)


class BranchedSeed(int):
    """The seed of a run that switches to other seeds from some instants on.

    Parameters
    ----------
    seed : int
        By which it begins.
    branches : sequence of (instant_ns, seed)
        From which instant since the start of the run it draws by which seed, in order.
    """

    branches: tuple[tuple[int, int], ...]

    def __new__(cls, seed: int, branches: Sequence[tuple[int, int]]) -> "BranchedSeed":
        """Return the seed with its branches."""
        result = super().__new__(cls, seed)
        result.branches = tuple(branches)
        return result

    def __getnewargs__(self) -> tuple[int, tuple[tuple[int, int], ...]]:  # type: ignore[override]
        return int(self), self.branches


def branch_seed(seed: int, from_ns: int, other: int) -> BranchedSeed:
    """Return the seed of a run that draws by `seed` before an instant and by `other` from it on."""
    before = [one for one in getattr(seed, "branches", ()) if one[0] < from_ns]
    return BranchedSeed(int(seed), [*before, (from_ns, other)])


#: When a branch begins that there is not, ns.
_NEVER_NS = 2**62


class Stream:
    """Random numbers of a block for one purpose; use one purpose for one distribution only.

    Of several runs, each with its own seed, `of_runs` tells the draws apart. `has_drawn_for_all`
    says whether something was drawn for all of them, with the seed of the first, and `shared` that
    this is refused: who serves all runs draws for each.

    What is drawn once for a run, or said to be of no instant, stays what it is in all branches of
    it. `branches` is how many the runs have at most.
    """

    branches = 0
    _of_many = False

    def __init__(self, seed: int | Sequence[int], block: str, purpose: str) -> None:
        self._block, self._purpose = block, purpose
        self.drew_for_all = self.shared = False
        seeds = [seed] if isinstance(seed, int) else seed
        self._of_many = len(seeds) > 1
        later = [getattr(one, "branches", ()) for one in seeds]
        self.branches = max(map(len, later))
        keys = [key_of(int(one), block, purpose) for one in seeds]
        if self.branches:
            #: When each branch of a run begins, (runs, branches); keys are those of the runs, and
            #: then those of their branches, one run after the other.
            self._begin_ns = np.full((len(seeds), self.branches), _NEVER_NS, dtype=np.int64)
            for number, some in enumerate(later):
                self._begin_ns[number, : len(some)] = [instant for instant, _ in some]
                after = [key_of(int(other), block, purpose) for _, other in some]
                keys += after + [0] * (self.branches - len(some))
        self._keys = np.array(keys, dtype=np.uint64)
        low, high = keys[0] & _LOW, keys[0] >> 32
        #: Of each round: two numbers, or arrays of the rows' shape.
        self._round_keys: Any = [
            ((low + first) & _LOW, (high + second) & _LOW) for first, second in _BUMPS
        ]

    def of_runs(self, run: IntArray, instant_ns: npt.ArrayLike | None = None) -> "Stream":
        """Return the stream for rows of these runs (`Wake.run`), drawing by each run's own seed.

        `instant_ns` says when since the start of its run each row is drawn, for what is drawn anew
        at every instant: a draw of one key must always be of the same instant. Runs that branched
        before then draw by their branch's seed; without it they draw as before they branched.
        """
        if len(self._keys) == 1:
            return self
        which = run
        if self.branches and instant_ns is not None:
            begun = self._begin_ns[run] <= np.asarray(instant_ns)[..., np.newaxis]
            which = self._branch_key_indices(run, begun.sum(axis=-1))
        return _RunStream(self._round_keys_of_all.take(which, axis=2))

    def branch_start_and_stream(self, run: IntArray, number: int) -> tuple[IntArray, "Stream"]:
        """Return when branch `number` (from 1) of runs begins, ns, and the stream of its draws."""
        keys = self._branch_key_indices(run, np.full(np.shape(run), number))
        return self._begin_ns[run, number - 1], _RunStream(
            self._round_keys_of_all.take(keys, axis=2)
        )

    def _branch_key_indices(self, run: IntArray, number: IntArray) -> IntArray:
        """Return the indices among the keys of the branches of runs; number 0 is the run itself."""
        later = len(self._begin_ns) + run * self.branches + number - 1
        return np.where(number > 0, later, run)

    @cached_property
    def _round_keys_of_all(self) -> UInt64Array:
        """The keys of all ten rounds for every run and branch, (rounds, 2, keys)."""
        both, bumps = np.array([self._keys & _U_LOW, self._keys >> _U32]), np.array(_BUMPS)
        rounds: UInt64Array = (both + bumps.astype(np.uint64)[:, :, np.newaxis]) & _U_LOW
        return rounds

    def _words(
        self, targets: npt.ArrayLike, scans: npt.ArrayLike, draw: int
    ) -> tuple[UInt64Array, UInt64Array, UInt64Array, UInt64Array]:
        if not 0 <= draw < 2**16:
            raise ValueError(f"draw is {draw}: it must lie in [0, 65536)")
        if self._of_many:
            self._note_draw_for_all()
        target = np.asarray(targets, dtype=np.uint64)
        numbers = np.asarray(scans, dtype=np.int64)
        # 48 bits of scan number: 280 trillion scans before a draw repeats.
        few = target.shape == numbers.shape and 0 < target.size <= _FEW and target.ndim == 1
        if few and not isinstance(self._round_keys, np.ndarray):
            words = [
                _ten_rounds(
                    draw | ((s >> 32) & 0xFFFF) << 16,
                    s & _LOW,
                    t & _LOW,
                    t >> 32,
                    self._round_keys,
                )
                for t, s in zip(target.tolist(), numbers.tolist(), strict=True)
            ]
            w0, w1, w2, w3 = np.array(words, dtype=np.uint64).T
            return w0, w1, w2, w3
        scan = numbers.astype(np.uint64)
        counter = (
            np.uint64(draw) | ((scan >> _U32) & np.uint64(0xFFFF)) << np.uint64(16),
            scan & _U_LOW,
            target & _U_LOW,
            target >> _U32,
        )
        keys = np.asarray(self._round_keys, dtype=np.uint64)
        return _philox_of_arrays(counter, keys)

    def _note_draw_for_all(self) -> None:
        self.drew_for_all = True
        if self.shared:
            raise ValueError(
                f"draws {self._purpose!r} of block {self._block!r} are of several runs: say of "
                "which each is (`stream.of_runs(wake.run)`)"
            )

    def uniform(self, targets: npt.ArrayLike, scans: npt.ArrayLike, draw: int = 0) -> FloatArray:
        """Return uniform draws in [0, 1) with 53 bits, keyed by target, scan and draw number.

        Parameters
        ----------
        targets : array of uint64
            Keys of the targets (`target_keys`), or 0 where a draw belongs to a scan as a whole.
        scans : array of int64
            Scan numbers; broadcast against `targets`.
        draw : int
            Number of the draw within its (target, scan).
        """
        w0, w1, w2, w3 = self._words(targets, scans, draw // 2)
        high, low = (w0, w1) if draw % 2 == 0 else (w2, w3)
        return ((high >> np.uint64(5)) * 67108864.0 + (low >> np.uint64(6))) * 2.0**-53

    def normal(self, targets: npt.ArrayLike, scans: npt.ArrayLike, draw: int = 0) -> FloatArray:
        """Return standard normal draws (Box-Muller), keyed as in `uniform`."""
        w0, w1, w2, w3 = self._words(targets, scans, draw)
        # The radius takes 1 - u, which is never 0, so the logarithm is finite.
        u = ((w0 >> np.uint64(5)) * 67108864.0 + (w1 >> np.uint64(6))) * 2.0**-53
        v = ((w2 >> np.uint64(5)) * 67108864.0 + (w3 >> np.uint64(6))) * 2.0**-53
        return np.sqrt(-2.0 * np.log1p(-u)) * np.cos(2.0 * np.pi * v)

    def three_normals(
        self, targets: npt.ArrayLike, scans: npt.ArrayLike, draw: int = 0
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return three independent standard normals from each key, for blocks that need many.

        They are made of 32 bits each, so none is larger than 6.7 in size. Of one (target, scan,
        draw) use either these or the others.
        """
        w0, w1, w2, w3 = self._words(targets, scans, draw)
        radius, angle = _box_muller_radius(w0), w1 * (2.0**-32 * 2.0 * np.pi)
        third = _box_muller_radius(w2) * np.cos(w3 * (2.0**-32 * 2.0 * np.pi))
        return radius * np.cos(angle), radius * np.sin(angle), third


#: Of which runs draws are is known: there is no choice among keys.
_KNOWN: UInt64Array = np.empty(0, dtype=np.uint64)


class _RunStream(Stream):
    """A stream with a known key for each row; draws have the shape of the targets or scans."""

    def __init__(self, round_keys: UInt64Array) -> None:
        self._keys, self._round_keys = _KNOWN, round_keys


def _box_muller_radius(word: UInt64Array) -> FloatArray:
    """Return the Box-Muller radius from 32 random bits, plus 1 so that the logarithm is finite."""
    radius: FloatArray = np.sqrt(-2.0 * np.log((word + 1.0) * 2.0**-32))
    return radius


class Streams:
    """All random streams of a run, or of several runs with a seed each, by block and purpose."""

    def __init__(self, seed: int | Sequence[int]) -> None:
        self.seed = seed if isinstance(seed, int) else seed[0]
        self._seeds = (seed,) if isinstance(seed, int) else tuple(seed)
        self._made: dict[tuple[str, str], Stream] = {}
        self._shared: set[str] = set()

    def stream(self, block: str, purpose: str) -> Stream:
        """Return a block's stream of random numbers for a purpose, the same object each time."""
        if (block, purpose) not in self._made:
            self._made[block, purpose] = Stream(self._seeds, block, purpose)
            self._made[block, purpose].shared = block in self._shared
        return self._made[block, purpose]

    def has_drawn_for_all(self, block: str) -> bool:
        """Return whether a block drew for several runs at once with the seed of the first."""
        return any(one.drew_for_all for (of, _), one in self._made.items() if of == block)

    def forbid_draws_for_all(self, block: str) -> None:
        """From now on raise an error if the block draws without saying for which runs."""
        self._shared.add(block)
        for (of, _), stream in self._made.items():
            stream.shared = stream.shared or of == block

    def scan_normal_function(self, block: str, purpose: str) -> Callable[[IntArray], FloatArray]:
        """Return a function from scan numbers to standard normal draws, for clock jitter."""
        stream = self.stream(block, purpose)
        return lambda scans: stream.normal(np.uint64(0), scans)
