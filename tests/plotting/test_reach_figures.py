"""Figures of reachable sets."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.tasks.motion.tracking import track
from equimorph.tasks.reach.reachable_sets import attainable, reachable
from typecheck import unchecked


@pytest.fixture(scope="module")
def reach(spring_set, ends):
    spring = spring_set.structure
    with unchecked():
        return reachable(spring_set, ends[0], [spring.angle, spring.height])


def test_boundary_pieces_are_drawn_where_they_are(reach):
    ax = plotting.reach_plane(reach)
    drawn = [np.asarray(line.get_xydata()) for line in ax.lines]
    for piece in reach.boundary:
        assert any(each.shape == piece.values.shape and (each == piece.values).all()
                   for each in drawn)  # fmt: skip
    plane = plotting.reach_parameters(reach)
    assert plane.get_xlabel() == "$x_l$ (natural length)"
    styles = {str(line.get_linestyle()) for line in plane.lines}
    assert len(styles) >= 3


def test_panels_show_region_and_motion(reach):
    spring = reach.start.structure
    both = track(
        reach.start, {spring.angle: 0.8, spring.height: 0.7}, actuators=["x_l", "F"]
    )  # fmt: skip
    figure = plotting.reach_panels(reach, both)
    assert isinstance(figure, Figure)
    assert [ax.get_title("left") for ax in figure.axes if ax.name != "3d"] == ["(a)", "(c)", "(d)"]
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["snap-through", "singular Jacobian", "actuator limit", "motion"]


def test_other_numbers_of_descriptors_are_refused(spring_set, ends):
    with unchecked():
        found = attainable(spring_set, ends[0], [spring_set.structure.angle])
    with pytest.raises(InputError, match="over two parameters, of two descriptors; got 2 and 1"):
        plotting.reach_plane(found)
