"""Figure of the snap graph."""

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.manifold import equilibrium_set, snap_graph
from equimorph.model import Box
from equimorph.structures import Spring
from typecheck import unchecked


@pytest.fixture(scope="module")
def graph(spring_set):
    with unchecked():
        return snap_graph(spring_set, samples=5)


def test_snaps_are_drawn_where_they_begin_and_end(graph):
    """Each tried vertex in the plane; in the other panel its angle, and the one it snaps to."""
    figure = plotting.snap_panels(graph)
    assert isinstance(figure, Figure)
    plane, along, bar = figure.axes
    tried = [vertex for snap in graph.snaps for vertex in snap.vertices]
    marked = np.concatenate([np.asarray(each.get_offsets()) for each in plane.collections])
    np.testing.assert_array_equal(marked, graph.eset.coordinates[tried])
    landed = [landing for snap in graph.snaps for landing in snap.landings]
    ends = np.concatenate([np.asarray(each.get_offsets())[:, 1] for each in along.collections])
    np.testing.assert_allclose(ends, [each.state.z[0] for each in landed], rtol=1e-12)
    assert bar.get_ylabel().startswith("energy released")
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["1 stable", "2 stable", "stability boundary", "snaps to a state of the set"]


def test_colours_tell_the_energy(graph):
    """The darkest snap frees least, and lightness grows with what is freed."""
    along = plotting.snap_panels(graph).axes[1]
    freed = [landing.released for snap in graph.snaps for landing in snap.landings]
    shown = [to_rgba(each.get_facecolor()[0]) for each in along.collections]
    lightness = np.array([0.2126 * r + 0.7152 * g + 0.0722 * b for r, g, b, _ in shown])
    assert (np.diff(lightness[np.argsort(freed)]) > -1e-12).all()


def test_other_sets_are_refused():
    with unchecked():
        box = Box(F=(-0.4, 0.4))
        line = equilibrium_set(Spring(), box, fixed={"x_l": 0.7}, intervals=(9,), checks=0)
        plane = equilibrium_set(
            Spring(), Box(x_l=(1.1, 1.4), F=(-0.1, 0.1)), intervals=(3, 4), checks=0
        )
    with pytest.raises(InputError, match="two free parameters; got F"):
        plotting.snap_panels(snap_graph(line))
    with pytest.raises(InputError, match="stability boundary"):
        plotting.snap_panels(snap_graph(plane))
