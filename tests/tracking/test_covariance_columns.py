"""Covariances as matrices, from the columns of their upper triangles."""

import numpy as np

from components.messages.columns import ORIGIN, POSITION, STATE, VELOCITY
from components.messages.state_tracks import COVARIANCE, StateTracks, covariance_matrices


def test_every_element_stands_where_its_column_says():
    root = np.random.default_rng(5).normal(size=(6, 6, 7))
    whole = np.einsum("ijn,kjn->ikn", root, root)
    columns = {
        f"covariance_{i}{j}_m2{('', '_s', '_s2')[(i > 2) + (j > 2)]}": whole[i, j]
        for i in range(6)
        for j in range(i, 6)
    }
    assert set(columns) == set(COVARIANCE.values())
    rows = np.array([6, 0, 3])
    np.testing.assert_array_equal(covariance_matrices(columns, rows), whole[..., rows])
    np.testing.assert_array_equal(covariance_matrices(columns, rows, 3), whole[:3, :3, rows])


def test_groups_of_columns_are_fields_of_the_message():
    assert (*POSITION, *VELOCITY) == STATE and len(STATE) == 6 and len(ORIGIN) == 3
    assert {*STATE, *ORIGIN} <= StateTracks.__dataclass_fields__.keys()
