"""Level sets on a plane, and bounds that a set was not cut at."""

import numpy as np
import pytest

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.manifold import divided_by, equilibrium_set
from equimorph.model import Box
from equimorph.plotting import style
from equimorph.plotting.scene import Scene
from equimorph.structures import Spring, value_of

BOUND = 0.3


def residual(x_l, delta):
    """PHYSICS §2: the load that keeps the spring at an angle."""
    return (1 - x_l / np.cos(delta)) * np.sin(delta)


def test_levels_are_exact_and_dashed_where_unstable(spring_set, route):
    spring = spring_set.structure
    length, load = value_of(spring, "x_l"), value_of(spring, "F")
    ax = plotting.level_plane(spring_set, (length, spring.angle), load, [0.05], route=route)
    thin = [line for line in ax.lines if line.get_linewidth() < 1.0]
    assert len(thin) >= 2
    for line in thin:
        x_l, delta = line.get_xdata(), line.get_ydata()
        drawn = np.isfinite(x_l)
        np.testing.assert_allclose(residual(x_l[drawn], delta[drawn]), 0.05, rtol=0, atol=1e-9)
        stable = x_l[drawn] > np.cos(delta[drawn]) ** 3 - 1e-9
        assert stable.all() if line.get_linestyle() == "-" else (~stable).sum() > 0
    (boundary,) = [line for line in ax.lines if line.get_linewidth() == 1.8]
    np.testing.assert_allclose(
        boundary.get_xdata(), np.cos(boundary.get_ydata()) ** 3, rtol=0, atol=1e-9
    )
    assert ax.get_xlabel() == "$x_l$ (natural length)"
    assert "0.05" in [text.get_text() for text in ax.texts]
    labels = [text.get_text() for text in ax.figure.legends[0].get_texts()]
    assert labels == ["stable", "index 1", "stability boundary", "levels of $F$ (k)", "route"]


def test_other_numbers_of_parameters_are_refused():
    spring = Spring()
    curve = equilibrium_set(spring, Box(F=(-0.1, 0.1)), fixed={"x_l": 0.8})
    plane = (spring.angle, spring.height)
    with pytest.raises(InputError, match="two free parameters; got F"):
        plotting.level_plane(curve, plane, spring.angle, [0.1])


def test_a_set_is_divided_exactly_at_a_bound(spring_set):
    angle = spring_set.structure.angle
    division = divided_by(spring_set, angle <= BOUND)
    values = angle(division.eset.points)
    np.testing.assert_allclose(values[division.on_level], BOUND, rtol=0, atol=1e-12)
    ends = values[division.eset.cells] - BOUND
    assert (ends[division.side > 0] > -1e-12).all()
    assert (ends[division.side < 0] < 1e-12).all()
    assert len(division.side) == len(division.eset.cells)


def test_a_limit_is_drawn_on_the_surface_and_in_the_plane(spring_set):
    """Both lines lie where δ = 0.3; in the plane of stable states only where it is stable."""
    angle = spring_set.structure.angle
    ax = plotting.surface(spring_set, angle, limit=angle <= BOUND)
    (scene,) = [each for each in ax.get_children() if isinstance(each, Scene)]
    dashes = style.LIMIT_LINE["linestyle"]
    lines = [each.points for each in scene.curves if each.seen.get("linestyle") == dashes]
    heights = np.concatenate(lines)[:, 2]
    np.testing.assert_allclose(heights, BOUND, rtol=0, atol=1e-9)
    plane = plotting.parameter_plane(spring_set, count="stable", limit=angle <= BOUND)
    (bound,) = [each for each in plane.lines if each.get_linewidth() == 1.2]
    x_l, load = bound.get_xdata(), bound.get_ydata()
    np.testing.assert_allclose(residual(x_l, BOUND), load, rtol=0, atol=1e-9)
    assert (x_l > np.cos(BOUND) ** 3 - 1e-9).all()


def test_panels_of_a_route_number_its_corners_alike(spring_set, route, refused):
    angle = spring_set.structure.angle
    figure = plotting.route_panels(spring_set, route, angle, limit=angle <= BOUND)
    solid, plane, shapes = figure.axes[:3]
    count = len(route.schedule.way_points)
    numbers = [text.get_text() for text in solid.texts]
    assert numbers == [str(k) for k in range(1, count + 1)]
    assert {text.get_text() for text in shapes.texts} <= set(numbers)
    assert [ax.get_title("left") for ax in (plane, shapes)] == ["(b)", "(c)"]
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "δ = 0.3" in labels
    with pytest.raises(InputError, match="refused"):
        plotting.route_panels(spring_set, refused, angle)
