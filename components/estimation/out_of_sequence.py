"""Late measurements in one step, by the correlation of the present state with the earlier one.

With the state before the measurement's own instant and the state now, the measurements between the
two stand for one of the state now. So the state then follows by one step of smoothing, is corrected
as any state is, and what the correction tells of the state now follows from their covariance.

Sources: Bar-Shalom, *Update with out-of-sequence measurements in tracking: exact solution*, IEEE
Trans. AES 38 (2002), algorithm A1, for a measurement that only one came before: exact for linear
models; Bar-Shalom, Chen, Mallick, *One-step solution for the multistep out-of-sequence-measurement
problem in tracking*, IEEE Trans. AES 40 (2004), algorithm Al1, for more of them: exact without
noise of the process, and an approximation with it. Written as smoothing (Rauch, Tung, Striebel
1965), which needs no inverse of the motion and keeps covariances positive.
"""

from dataclasses import dataclass

from components.estimation.batched import (
    cholesky,
    matrix_product,
    matrix_times_vector,
    multiply_by_transpose,
    solve_lower,
    solve_lower_transposed,
    symmetrised,
)
from components.estimation.carried_errors import MotionWithErrors
from components.estimation.motion import Motion, predict
from dsa_des.arrays.types import FloatArray


@dataclass(frozen=True, eq=False)
class Retrodiction:
    """A past state estimated from all known now, and the gain that carries corrections to now."""

    state: FloatArray  # (d, n)
    covariance: FloatArray  # (d, d, n)
    # (d, d, n), how much of a correction of the state then is one of the state now
    gain: FloatArray

    def carry_forward(
        self,
        state: FloatArray,
        covariance: FloatArray,
        corrected: FloatArray,
        corrected_covariance: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the present state and covariance after the past ones are corrected to these."""
        less = multiply_by_transpose(
            matrix_product(self.gain, corrected_covariance - self.covariance), self.gain
        )
        moved = state + matrix_times_vector(self.gain, corrected - self.state)
        return moved, symmetrised(covariance + less)


def retrodict_between(
    model: Motion,
    before: tuple[FloatArray, FloatArray],
    now: tuple[FloatArray, FloatArray],
    until_then_s: FloatArray,
    since_then_s: FloatArray,
) -> Retrodiction:
    """Return the smoothed state at an instant between an earlier estimate and the present one."""
    then, spread = predict(model, *before, until_then_s)
    step, noise = model.jacobian(then, since_then_s), model.noise(since_then_s)
    ahead, spread_ahead = predict(model, then, spread, since_then_s)
    back = _transpose_times_inverse(
        matrix_product(step, spread), spread_ahead
    )  # spread · stepᵀ / spread ahead
    rest = -matrix_product(back, step)
    for i in range(model.size):
        rest[i, i] += 1.0
    total = multiply_by_transpose(matrix_product(rest, spread), rest)
    total += multiply_by_transpose(matrix_product(back, noise + now[1]), back)
    covariance = symmetrised(total)
    across = multiply_by_transpose(back, now[1])  # of the state then with the state now
    return Retrodiction(
        then + matrix_times_vector(back, now[0] - ahead),
        covariance,
        _transpose_times_inverse(across, covariance),
    )


def retrodict_before_start(
    model: Motion, now: tuple[FloatArray, FloatArray], since_s: FloatArray
) -> Retrodiction:
    """Return the state at a time before the first report, by moving the present estimate back.

    Errors that are forgotten were as large then as they are now: backwards they are forgotten as
    they are forwards, and of one that is new at every instant nothing is known.
    """
    state, spread = now
    step, noise = model.jacobian(state, -since_s), model.noise(since_s)
    since = multiply_by_transpose(matrix_product(step, noise), step)
    if isinstance(model, MotionWithErrors):
        since[model.error_slice, model.error_slice] = noise[model.error_slice, model.error_slice]
    covariance = symmetrised(multiply_by_transpose(matrix_product(step, spread), step) + since)
    return Retrodiction(
        model.move(state, -since_s),
        covariance,
        _transpose_times_inverse(matrix_product(step, spread), covariance),
    )


def _transpose_times_inverse(left: FloatArray, matrix: FloatArray) -> FloatArray:
    """Return leftᵀ · matrix⁻¹ for symmetric matrices (d, d, n)."""
    root = cholesky(matrix)
    return solve_lower_transposed(root, solve_lower(root, left)).swapaxes(0, 1)
