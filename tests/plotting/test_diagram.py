"""Bifurcation diagrams, and states on the plane."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex

import equimorph as em
from equimorph import plotting
from equimorph.plotting import style
from sets import spring_set
from typecheck import unchecked


@pytest.fixture(scope="module")
def spring():
    return em.Spring()


@pytest.fixture(scope="module")
def branch(spring):
    within = [spring.angle <= 1.2, spring.angle >= -1.2]
    with unchecked():
        return em.equilibrium_set(spring, em.Box(F=(-0.1, 0.1)), fixed={"x_l": 0.8}, within=within)


@pytest.fixture(scope="module")
def plane():
    return spring_set()


def test_stable_pieces_are_full_lines_and_folds_are_marked(branch, spring):
    """Folds at F/k = ±sin³δ with cos³δ = x_l, PHYSICS section 2."""
    ax = plotting.diagram(branch, spring.angle)
    drawn = [each for each in ax.collections if isinstance(each, LineCollection)]
    assert [len(each.get_segments()) for each in drawn] == [2, 1]
    assert drawn[0].get_linewidths()[0] > drawn[1].get_linewidths()[0]
    shown = [to_hex(style.INK), to_hex(style.index_colour(1))]
    assert [to_hex(each.get_color()[0]) for each in drawn] == shown
    assert [to_hex(each.get_color()) for each in ax.get_legend().legend_handles[:2]] == shown
    words = [text.get_text() for text in ax.get_legend().get_texts()]
    assert words == ["stable", "index 1", "fold"]
    (folds,) = (line for line in ax.lines if line.get_label() == "fold")
    fold = (1.0 - 0.8 ** (2.0 / 3.0)) ** 1.5
    np.testing.assert_allclose(np.sort(folds.get_xdata()), [-fold, fold], rtol=1e-9)


def test_a_diagram_of_a_surface_is_refused(plane):
    with pytest.raises(em.InputError, match="must have one free parameter; got x_l, F"):
        plotting.diagram(plane)


def test_states_are_numbered_and_filled_where_stable(plane):
    ax = plotting.solutions(plane, plane.at(x_l=0.7, F=0.01))
    stable, unstable = (line for line in ax.lines if line.get_linestyle() == "None")
    assert len(stable.get_xdata()) == 2
    assert len(unstable.get_xdata()) == 1
    assert "1, 2, 3" in [text.get_text() for text in ax.texts]


def test_states_over_one_parameter_have_no_plane(branch):
    with pytest.raises(em.InputError, match="must have two free parameters; got F"):
        plotting.solutions(branch, branch.at(F=0.0))


def test_portraits_carry_their_labels(plane):
    both = plane.at(x_l=0.7, F=0.01).stable
    ax = plotting.portraits(both, labels=["up", "down"])
    assert [text.get_text() for text in ax.texts] == ["up", "down"]
    drawn = [
        line.get_xydata() for line in ax.lines if len(line.get_xdata()) == both.shape().shape[1]
    ]
    np.testing.assert_array_equal(drawn[-2:], both.shape())


def test_portraits_need_a_label_for_each(plane):
    with pytest.raises(em.InputError, match="got 1 for 3"):
        plotting.portraits(plane.at(x_l=0.7, F=0.01), labels=["one"])
