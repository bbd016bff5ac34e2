"""Rasters with voids, as tiles of SRTM have them, and packed ones."""

import gzip
import zipfile

import numpy as np
import pytest

from components.terrain.raster import mosaic, read_raster
from components.terrain.voids import fill_voids
from dsa_des.running.reports import notes_of_scene
from dsa_des.running.simulation import Simulation
from dsa_des.scene.scene import load_scene

VOID = -32768


def hgt(path, heights):
    """Rows are given from south to north."""
    path.write_bytes(np.asarray(heights)[::-1].astype(">i2").tobytes())
    return path


def plane(nodes=41):
    row, column = np.mgrid[:nodes, :nodes]
    return 300.0 + 3.0 * row - 2.0 * column


@pytest.mark.parametrize(
    "void", [np.s_[5:9, 20:30], np.s_[0:3, 10:14], np.s_[38:, 38:], np.s_[7, 7]]
)
def test_even_ground_is_filled_evenly(tmp_path, void):
    """Inside of the raster exactly; at its edges, where a rim lacks, never beyond the rim."""
    heights = plane()
    heights[void] = VOID
    raster = read_raster(hgt(tmp_path / "N45E007.hgt", heights))
    made, true = raster.height_m[void], plane()[void]
    assert raster.filled == np.size(true)
    if void in (np.s_[5:9, 20:30], np.s_[7, 7]):
        assert made == pytest.approx(true, abs=1e-3)
    rest = np.ones_like(heights, dtype=bool)
    rest[void] = False
    assert (raster.height_m[rest] == plane()[rest]).all()
    near = np.zeros_like(rest)
    rows, columns = np.nonzero(~rest)
    near[rows.min() - (rows.min() > 0) : rows.max() + 2,
         columns.min() - (columns.min() > 0) : columns.max() + 2] = True  # fmt: skip
    rim = plane()[near & rest]
    assert rim.min() <= made.min() and made.max() <= rim.max()


def test_a_node_is_the_mean_of_its_neighbours():
    heights = np.array([[1.0, 2.0, 3.0], [4.0, np.nan, 6.0], [7.0, 9.0, 9.0]] * 3)
    heights[4, 1], heights[7, 1] = 5.0, 5.0
    filled, count = fill_voids(np.tile(heights, (1, 3)))
    assert count == 3 and filled[1, 1] == pytest.approx((2 + 4 + 6 + 9) / 4)


def test_too_many_voids_are_refused(tmp_path):
    heights = plane()
    heights[10:20, 10:20] = VOID
    with pytest.raises(ValueError, match=r"has 100 holes .* up to 5% of a file's nodes are filled"):
        read_raster(hgt(tmp_path / "N45E007.hgt", heights))


def test_packed_tiles_are_read(tmp_path):
    plain = hgt(tmp_path / "N45E007.hgt", plane())
    whole = read_raster(plain)
    packed = tmp_path / "N45E007.hgt.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        archive.write(plain, "N45E007.hgt")
    other = tmp_path / "N45E007.hgt.gz"
    other.write_bytes(gzip.compress(plain.read_bytes()))
    for path in (packed, other):
        assert (read_raster(path).height_m == whole.height_m).all()
    for data in (packed.read_bytes()[:60], other.read_bytes()[:60]):
        packed.write_bytes(data)
        with pytest.raises(ValueError, match="is a damaged archive"):
            read_raster(packed)
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("readme.txt", "none")
    with pytest.raises(ValueError, match=r"holds 0 \.hgt files: one is needed"):
        read_raster(packed)


def test_filled_nodes_are_counted_over_all_tiles_and_said(tmp_path, configs):
    heights = plane(11)
    heights[4, 4:6] = VOID
    tiles = [hgt(tmp_path / name, heights) for name in ("N04E003.hgt", "N04E004.hgt")]
    assert mosaic([read_raster(path) for path in tiles]).filled == 4
    scene = load_scene(configs / "terrain/behind_the_ridge.toml")
    path = scene.sections["terrain"].raster.paths[0]
    whole = np.frombuffer(path.read_bytes(), dtype=">i2").copy()
    whole[1000] = VOID
    other = tmp_path / path.name
    other.write_bytes(whole.tobytes())
    scene = load_scene(
        configs / "terrain/behind_the_ridge.toml", sets=[f"terrain.raster={str(other)!r}"]
    )
    (said,) = [note for note in notes_of_scene(Simulation(scene)) if note.startswith("terrain: ")]
    assert "raster: 1 nodes without a height (0.00%) in S42W180.hgt" in said
