"""Colours are bound to the kind of block, whatever else a scene holds."""

from itertools import combinations

import numpy as np

from components.display.styles import styles_of
from components.fusion.gated import Gated
from components.optical.eo import ElectroOptical
from components.optical.ir import Infrared
from components.optical.projection import Projection
from components.radar.radar import RangeBoundary
from components.radar.swerling import SwerlingRadar
from components.sensor import marks
from components.tracking.stub import TrackerStub
from dsa_des.block.component import Component
from dsa_des.block.mark import NEUTRAL, marks_of

KINDS = [marks.RADAR, marks.EO, marks.IR, marks.FUSION, marks.TRACKER]


def test_every_block_of_a_kind_has_the_colour_of_its_kind() -> None:
    for cls, kind in ((SwerlingRadar, marks.RADAR), (RangeBoundary, marks.RADAR),
                      (ElectroOptical, marks.EO), (Projection, marks.EO), (Infrared, marks.IR),
                      (Gated, marks.FUSION), (TrackerStub, marks.TRACKER)):  # fmt: skip
        for names in (["a", "b", "z"], ["z"]):
            classes: dict[str, type | None] = dict.fromkeys(names, Component) | {"z": cls}
            assert marks_of(classes)["z"] == kind, cls


def test_two_of_a_kind_share_the_colour_and_not_the_marker() -> None:
    found = marks_of({"front": SwerlingRadar, "aft": RangeBoundary})
    assert found["front"].colour == found["aft"].colour == marks.RADAR.colour
    assert found["front"].marker != found["aft"].marker


def test_a_block_that_says_nothing_is_neutral_and_a_missing_one_too() -> None:
    found = styles_of(["gone", "mine"], {"mine": object()})
    assert list(found.values()) == list(NEUTRAL[:2])


def test_no_two_colours_are_close_to_eyes_without_red_or_green() -> None:
    """Distances in what is left when red and green are one (Vienot, Brettel and Mollon 1999)."""
    to_lms = np.array([[17.8824, 43.5161, 4.11935], [3.45565, 27.1554, 3.86714],
                       [0.0299566, 0.184309, 1.46709]])  # fmt: skip
    for blind in ([[0, 2.02344, -2.52581], [0, 1, 0], [0, 0, 1]],
                  [[1, 0, 0], [0.494207, 0, 1.24827], [0, 0, 1]]):  # fmt: skip
        seen = {}
        for mark in KINDS:
            rgb = np.array([int(mark.colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255
            linear = rgb**2.2
            left = np.linalg.inv(to_lms) @ np.array(blind) @ to_lms @ linear
            seen[mark.colour] = np.clip(left, 0, 1) ** (1 / 2.2)
        for one, other in combinations(seen, 2):
            assert np.linalg.norm(seen[one] - seen[other]) > 0.1, (one, other)
