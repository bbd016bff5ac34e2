"""Networks in `.nnet` text, as NASA's and Stanford's tools for collision avoidance write them.

Lines that begin with ``//`` are remarks. Then, in values that commas end: the number of layers, of
inputs, of outputs and the widest layer; the size of each layer, the inputs' first; one unused line;
least and greatest inputs; means and ranges of the inputs and, last, of all outputs; and of each
layer the rows of its weights and its biases, one a line (https://github.com/sisl/NNet).
"""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from dsa_des.arrays.types import FloatArray
from dsa_des.errors import UsageError
from dsa_des.files.input_files import InputFileError, read_input_text

_MOST = 10_000


@dataclass(frozen=True)
class Network:
    """A network of linear layers with rectifiers between them.

    Parameters
    ----------
    least, greatest : (inputs,)
        Inputs beyond are taken as these.
    mean, scale : (inputs + 1,)
        The last are those of the outputs.
    layers : tuple of (weights (rows, columns), biases (rows,))
    """

    least: FloatArray
    greatest: FloatArray
    mean: FloatArray
    scale: FloatArray
    layers: tuple[tuple[FloatArray, FloatArray], ...]

    def outputs(self, inputs: FloatArray) -> FloatArray:
        """Return the outputs (outputs,) of inputs (inputs,)."""
        values = (np.clip(inputs, self.least, self.greatest) - self.mean[:-1]) / self.scale[:-1]
        for number, (weights, biases) in enumerate(self.layers, start=1):
            values = weights @ values + biases
            if number < len(self.layers):
                values = np.maximum(values, 0.0)
        return np.asarray(values * self.scale[-1] + self.mean[-1])


def read_nnet(path: Path, inputs: int, outputs: int) -> Network:
    """Read a neural network from a .nnet file and check its numbers of inputs and outputs.

    Raises
    ------
    UsageError
        It cannot be read, or is another; with its line.
    """
    try:
        text = read_input_text(path)
    except InputFileError as error:
        raise UsageError(f"{path}: {error}") from None
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.startswith("//")
    ]
    at = 0

    def take(count: int | None, what: str) -> FloatArray:
        nonlocal at
        if at == len(lines):
            raise UsageError(f"{path}: ends before {what}")
        number, line = lines[at]
        at += 1
        try:
            values = np.array([float(cell) for cell in line.split(",") if cell.strip()])
        except ValueError:
            values = np.array([np.nan])
        if not np.isfinite(values).all():
            raise UsageError(f"{path}: line {number}: {what}: holds something else than numbers")
        if count is not None and len(values) != count:
            raise UsageError(f"{path}: line {number}: {what}: {len(values)} values, not {count}")
        return values

    layers = int(take(4, "the numbers of layers, inputs, outputs and of the widest layer")[0])
    sizes = take(None, "the size of each layer").astype(int).tolist()
    if len(sizes) != layers + 1 or not all(0 < size <= _MOST for size in sizes):
        raise UsageError(f"{path}: the size of each layer: {sizes} for {layers} layers")
    if (sizes[0], sizes[-1]) != (inputs, outputs):
        raise UsageError(
            f"{path}: has {sizes[0]} inputs and {sizes[-1]} outputs: {inputs} and {outputs} are "
            "needed"
        )
    take(None, "the line that is not used")
    least, greatest = take(inputs, "least inputs"), take(inputs, "greatest inputs")
    mean, scale = take(inputs + 1, "means"), take(inputs + 1, "ranges")
    if not (scale > 0.0).all() or not (least <= greatest).all():
        raise UsageError(f"{path}: a range is not above 0, or a least input above the greatest")
    made = []
    for number, (before, after) in enumerate(pairwise(sizes), start=1):
        what = f"layer {number}"
        weights = np.stack([take(before, f"weights of {what}") for _ in range(after)])
        biases = np.concatenate([take(1, f"biases of {what}") for _ in range(after)])
        made.append((weights, biases))
    if at != len(lines):
        raise UsageError(f"{path}: line {lines[at][0]}: goes on after the last layer")
    return Network(least, greatest, mean, scale, tuple(made))
