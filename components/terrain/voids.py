"""Voids of an elevation raster: nodes without a height, filled from their rims."""

import numpy as np

from dsa_des.arrays.types import BoolArray, FloatArray

#: Up to this share of a raster's nodes is filled; beyond it too much ground would be made up.
MOST_VOIDS = 0.05


def fill_voids(height_m: FloatArray) -> tuple[FloatArray, int]:
    """Return heights (rows, columns) without their voids (NaN), and how many nodes were filled.

    Filled ground is as smooth as its rim lets it be: every node is the mean of its neighbours
    (Laplace's equation), so that none is higher or lower than the rim, and what rises evenly around
    a void rises so inside of it. More than `MOST_VOIDS` of the nodes are left as they are.
    """
    voids: BoolArray = np.isnan(height_m)
    count = int(np.count_nonzero(voids))
    if not 0 < count <= MOST_VOIDS * height_m.size:
        return height_m, 0
    from scipy.sparse import coo_matrix, diags
    from scipy.sparse.linalg import spsolve

    number = np.full(height_m.shape, -1, dtype=np.int64)
    number[voids] = np.arange(count)
    at = np.nonzero(voids)
    neighbours, known = np.zeros(count), np.zeros(count)
    pairs: list[tuple[FloatArray, FloatArray]] = []
    for down, right in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        row, column = at[0] + down, at[1] + right
        inside = (row >= 0) & (row < height_m.shape[0]) & (column >= 0)
        inside &= column < height_m.shape[1]
        here = np.flatnonzero(inside)
        row, column = row[inside], column[inside]
        neighbours[here] += 1.0
        there = number[row, column]
        rim = there < 0
        known[here[rim]] += height_m[row, column][rim]
        pairs.append((here[~rim], there[~rim]))
    first, second = (np.concatenate(part) for part in zip(*pairs, strict=True))
    between = coo_matrix((np.ones(len(first)), (first, second)), shape=(count, count))
    result = height_m.copy()
    result[voids] = spsolve((diags(neighbours) - between).tocsc(), known)
    return result, count
