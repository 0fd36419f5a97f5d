"""Whether a plan is that of the place: rays counted by hand, and filters on others' plans."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest

from formats.errors import Notes
from formats.frame import Pose
from formats.plans.file import open_plan
from replay.localise.doubt import Fit, fit_of, unsure
from replay.localise.field import Field, build_field
from replay.localise.likelihood import Reading
from replay.localise.options import DEFAULTS
from replay.localise.tracking import amcl
from tests.localising import CELL, OFFICE, TOUR, drifting, drive, way
from tests.worlds import world_png

ROOMS = """
####################
#.........##.......#
#.........##.......#
#.........##.......#
#.........##.......#
#.........##.......#
####################
"""
"""10 x 3.5 m at 0.5 m a character: the wall between the rooms is from x = 5 to 6 m."""
OTHER = """
################################
#..............#...............#
#..............#...............#
#..............................#
#..............#...............#
#..............#...............#
#.....####################.....#
#....#....................#....#
#....#....................#....#
#.........................#....#
#....#....................#....#
#....######################....#
#..............................#
#..............................#
################################
"""


def field_of(folder: Path, text: str, cell: float) -> Field:
    return build_field(open_plan(world_png(folder / "p.png", text), Notes(), resolution=cell))


def looking(bearings: list[float], ranges: list[float]) -> Reading:
    return Reading(Pose(0.5, 0.0, 0.0), np.array(bearings), np.array(ranges), 50.0)


@pytest.mark.parametrize(
    ("ahead", "fit"),
    [
        (3.5, (0.5, 0.0)),  # at the wall
        (1.0, (0.25, 0.0)),  # before it
        (4.0, (0.25, 0.0)),  # half way into it: neither at a face nor through
        (4.6, (0.5, 0.0)),  # at its other face
        (5.5, (0.25, 0.5)),  # in the other room
    ],
)
def test_beams_end_before_at_and_behind_walls(
    tmp_path: Path, ahead: float, fit: tuple[float, float]
) -> None:
    """From the sensor at 1.5, 1.75 m: ahead twice or thereabouts, left a metre and right 1.25 m.

    The walls at the sides are at 0.5 and 3 m, 1.25 m away, so that only the right beam ends there.
    """
    room = field_of(tmp_path, ROOMS, 0.5)
    reading = looking([0.0, 0.01, pi / 2, -pi / 2], [ahead, ahead if fit[1] else 0.2, 1.0, 1.25])
    found = fit_of(room, np.array([[1.0, 1.75, 0.0]]), [reading])
    assert found == pytest.approx(fit)


def test_a_beam_along_a_wall_is_not_through_it(tmp_path: Path) -> None:
    """Two degrees to the side it may go a longer way before it is through."""
    room = field_of(tmp_path, ROOMS, 0.5)
    # The wall below ends 1.75 m below: after 1.75 / sin (0.53 - 0.035) = 3.68 m at the most.
    for far, through in ((3.9, 0.0), (4.2, 1.0)):
        reading = looking([-0.53], [far])
        assert fit_of(room, np.array([[1.0, 1.75, 0.0]]), [reading]).through == through
    grazing = looking([-0.02], [3.5])
    assert fit_of(room, np.array([[1.0, 0.55, 0.0]]), [grazing]).through == 0.0


def test_no_beams_no_doubt(tmp_path: Path) -> None:
    room = field_of(tmp_path, ROOMS, 0.5)
    assert fit_of(room, np.array([[1.0, 1.75, 0.0]]), [looking([], [])]).doubt == ""
    assert Fit(0.5, 0.1).doubt == ""
    assert Fit(0.5, 0.4).doubt == "50% of the beams end at its walls, 40% go through them"


def test_anywhere_is_as_far_as_the_free_space(tmp_path: Path) -> None:
    """A room of 4 x 2 m, seen from its middle and from 3 m beside it; headings are even."""
    alone = field_of(tmp_path, "##########\n" + 4 * "#........#\n" + "##########\n", 0.5)
    found = unsure(alone, np.array([[2.5, 1.5, 0.0], [5.5, 1.5, 1.0]]))
    expected = [[16 / 12, 4 / 12, pi**2 / 3], [9 + 16 / 12, 4 / 12, pi**2 / 3]]
    assert np.diagonal(found, axis1=1, axis2=2) == pytest.approx(np.array(expected), rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_on_the_plan_of_another_building_nothing_is_certain(tmp_path: Path, seed: int) -> None:
    truth = way(TOUR)
    other = field_of(tmp_path, OTHER, CELL)
    sightings = list(drive(OFFICE, truth, drifting(truth, seed), seed=seed))
    track = amcl(sightings, other, None, seed, DEFAULTS)
    assert track.settled == len(track.times_ns)
    assert track.covariances[:, 2, 2].min() > 0.1
    own = amcl(sightings, field_of(tmp_path, OFFICE, CELL), None, seed, DEFAULTS)
    assert own.ever
    assert own.doubt == ""
