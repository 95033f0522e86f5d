"""Shapes, margins and film of a route."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from equimorph import plotting
from equimorph.equilibria import lift
from equimorph.errors import InputError
from equimorph.model import Disc, HalfPlane, Schedule, names_of
from equimorph.plotting.curves import states_along
from equimorph.plotting.surroundings import Surroundings, obstacles_of
from equimorph.structures import Couple, PointForce, Rod, distance_to
from equimorph.tasks.route import Route

NOWHERE = Route("refused", "the goal is unstable", [])


def test_the_number_at_the_worst_place_does_not_cross_its_limit(route):
    """Just below a limit it stands beside its mark, else above or below."""
    angle = route.path.states.structure.angle
    values = angle(route.path.states)
    steps = np.linspace(0.0, 1.0, len(route.schedule.progress))
    values = np.interp(steps, np.linspace(0.0, 1.0, len(values)), np.abs(values))
    route = replace(route, schedule=replace(route.schedule, descriptors={angle.name: values}))
    peak = values.max()
    for limit, beside in ((1.05 * peak, True), (3.0 * peak, False)):
        ax = plotting.margins(route, within=[angle <= limit])
        lowest = ax.figure.axes[-1]
        (number,) = (each for each in lowest.texts if each.get_text() == f"{peak:.3g}")
        assert (number.get_va() == "center") == beside


def test_states_along_a_path_are_equilibria_from_its_start_to_its_end(route):
    states = states_along(route.path, 50)
    assert states.residual.max() < 1e-10
    assert (states.index == 0).all()
    np.testing.assert_allclose(states.z[[0, -1]], route.path.states.z[[0, -1]], atol=1e-10)


def test_states_along_a_path_that_ends_in_a_fold_stay_on_its_side(refused):
    """At the fold Newton's method may not converge or cross over; then a known state is taken."""
    angle = refused.path.states.structure.angle
    states = states_along(refused.path, 40)
    assert states.residual.max() < 1e-8
    assert (np.diff(angle(states)) <= 1e-12).all()
    assert angle(states)[-1] == pytest.approx(angle(refused.path.end.state), abs=1e-9)


def test_shapes_are_drawn_from_start_to_goal(route):
    ax = plotting.shapes(route, count=7)
    (drawn,) = [each for each in ax.collections if isinstance(each, LineCollection)]
    outlines = drawn.get_segments()
    assert len(outlines) == 7
    np.testing.assert_allclose(outlines[0], route.path.states[0].shape(), atol=1e-12)
    assert ax.get_aspect() == 1.0
    assert [text.get_text() for text in ax.texts] == ["start", "goal"]


def test_shapes_take_a_bare_path(route):
    assert plotting.shapes(route.path).get_xlabel() == "$x$ (natural length)"


def test_margins_mark_the_smallest_with_its_value(route):
    ax = plotting.margins(route)
    assert f"{route.margin:.3g}" in [text.get_text() for text in ax.texts]
    assert ax.get_ylim()[0] == 0.0


def test_margins_show_the_curvature_of_an_arch():
    arch = Rod()
    path = lift(arch.natural_state(Theta=1.0), {"Theta": 1.2})
    route = _route_of(path, {"max_curvature": arch.max_curvature(path.states)})
    ax = plotting.margins(route)
    lower = [other for other in ax.figure.axes if other is not ax]
    assert [other.get_ylabel() for other in lower] == ["max |κ| (1/L)"]


def test_film_has_the_frames_asked_for_and_stays_small(spring_set, route, tmp_path):
    file = plotting.film(route, tmp_path / "film.gif", spring_set, frames=12, fps=20)
    assert file.stat().st_size < 300_000
    with Image.open(file) as film:
        assert film.n_frames == 12
        assert film.info["loop"] == 0
        durations = []
        for k in range(film.n_frames):
            film.seek(k)
            durations.append(film.info["duration"])
    assert durations == [800, *[50] * 10, 1600]


def test_pictures_of_a_film_differ(spring_set, route, tmp_path):
    file = plotting.film(route, tmp_path / "film.gif", spring_set, frames=3)
    with Image.open(file) as film:
        pictures = []
        for k in range(3):
            film.seek(k)
            pictures.append(np.asarray(film.convert("RGB")).astype(int))
    assert all(np.abs(a - b).max() > 100 for a, b in pairwise(pictures))
    assert (pictures[0][0, 0] == 255).all()


def test_a_route_without_path_is_refused_with_its_reason(spring_set, tmp_path):
    with pytest.raises(InputError, match="the goal is unstable"):
        plotting.shapes(NOWHERE)
    with pytest.raises(InputError, match="the goal is unstable"):
        plotting.margins(NOWHERE)
    with pytest.raises(InputError, match="the goal is unstable"):
        plotting.film(NOWHERE, tmp_path / "film.gif", spring_set)


@pytest.mark.parametrize("wrong", [{"frames": 1}, {"fps": 0}])
def test_a_film_needs_frames_and_speed(spring_set, route, tmp_path, wrong):
    with pytest.raises(InputError, match=r"`(frames|fps)` must be a whole number from"):
        plotting.film(route, tmp_path / "film.gif", spring_set, **wrong)


def program(folder, monkeypatch, lines):
    """A program called ffmpeg of a few lines of shell, the only one that can be found."""
    file = folder / "ffmpeg"
    file.write_text(f"#!/bin/sh\n{lines}\n")
    file.chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:/bin:/usr/bin" if lines else "")


def test_a_film_is_an_mp4_where_ffmpeg_is_there(route, tmp_path, monkeypatch):
    """Its last argument is the file to write."""
    program(tmp_path, monkeypatch, 'for last; do :; done; echo film > "$last"')
    file = plotting.film(route, tmp_path / "film.mp4", frames=2)
    assert file.read_text() == "film\n"
    assert not list(tmp_path.glob("*.gif"))


def test_what_ffmpeg_cannot_do_is_said(route, tmp_path, monkeypatch):
    program(tmp_path, monkeypatch, "echo first >&2; echo Unknown encoder >&2; exit 1")
    with pytest.raises(OSError, match=r"ffmpeg cannot write film\.mp4: Unknown encoder"):
        plotting.film(route, tmp_path / "film.mp4", frames=2)


def test_other_films_are_refused(route, tmp_path, monkeypatch):
    program(tmp_path, monkeypatch, "")
    with pytest.raises(InputError, match=r"must end in \.gif \(\.mp4 needs the program ffmpeg\)"):
        plotting.film(route, tmp_path / "film.mp4")
    program(tmp_path, monkeypatch, "exit 0")
    with pytest.raises(InputError, match=r"end in \.gif or \.mp4; got 'film\.avi'"):
        plotting.film(route, tmp_path / "film.avi")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["ffmpeg"]


def test_one_shape_is_too_few(route):
    with pytest.raises(InputError, match="`count` must be at least 2; got 1"):
        plotting.shapes(route, count=1)


def test_pointers_of_an_arch_lie_along_its_end_tangents():
    """θ(0) = Δ + Θ, θ(1) = Δ − Θ: at B the direction into the rod is the opposite one."""
    states = lift(Rod().natural_state(Theta=0.9), {"Delta": 0.3}).states
    around = Surroundings(states)
    directions = [each.directions[-1] for each in around.drawing.supports]
    np.testing.assert_allclose(_angles(directions), [1.2, np.pi - 0.6], atol=1e-12)
    ax = Figure().add_subplot()
    parts = around.moving_parts(ax)
    pointers = [each.artist for each in parts if isinstance(each.artist, Line2D)]
    for part in parts:
        part.place(-1)
    drawn = [np.diff(each.get_xydata(), axis=0)[0] for each in pointers[:2]]
    np.testing.assert_allclose(_angles(drawn), [1.2, np.pi - 0.6], atol=1e-12)


def test_load_arrows_point_down_where_there_is_load():
    path = lift(Rod("left-half").natural_state(Theta=0.9), {"q": 1.0})
    ((tails, heads),) = Surroundings(path.states).arrows
    along = heads - tails
    assert (along[..., 0] == 0).all()
    assert (along[-1, :6, 1] < 0).all()
    assert (along[-1, 7:, 1] == 0).all()
    assert np.abs(along[0]).max() == 0.0


def test_an_unloaded_arch_has_no_arrows():
    states = lift(Rod().natural_state(Theta=0.9), {"Theta": 1.0}).states
    assert Surroundings(states).arrows == []
    ax = Figure().add_subplot()
    Surroundings(states).draw_still(ax)
    assert not [each for each in ax.get_children() if each.get_gid() == "load"]


def test_point_forces_have_arrows_that_end_at_the_rod():
    """One arrow along the force, as long as the picture allows; units of the user."""
    rod = Rod(ends=("clamped", "free"), loads={"P": PointForce(1.0, (0.6, -0.8))}, EI=2.0, length=3)
    path = lift(rod.natural_state(), {"P": 0.5})
    around = Surroundings(path.states)
    ((tails, heads),) = around.arrows
    head, tail = heads[-1, 0], tails[-1, 0]
    along = (head - tail) / np.hypot(*(head - tail))
    np.testing.assert_allclose(along, [0.6, -0.8], rtol=1e-12)
    tip = path.states.shape()[-1, -1]
    assert np.hypot(*(head - tip)) == pytest.approx(0.012 * around.size, rel=1e-9)
    assert around.size == pytest.approx(3.0, rel=1e-9)
    ax = Figure().add_subplot()
    around.draw_still(ax)
    (clamp,) = [patch for patch in ax.patches if patch.get_gid() == "clamp"]
    assert np.ptp(clamp.get_xy()[:, 1]) == pytest.approx(4.4 * 0.022 * 3)


def test_a_hinge_and_a_rail_show_how_a_rod_is_held():
    """The pinned end moves along a rail; the other is clamped, and turns in no state."""
    rod = Rod(ends=("clamped", "pinned"), curvature=-2.0)
    states = lift(rod.natural_state(theta_A=1.0), {"nu": 0.8}).states
    ax = Figure().add_subplot()
    Surroundings(states).draw_still(ax)
    triangles = [each for each in ax.patches if len(each.get_xy()) == 4]
    assert [each.get_gid() for each in triangles] == ["pin", "pin"]
    assert {each.get_gid() for each in ax.patches} == {"clamp", "pin"}
    (rail,) = [line for line in ax.lines if line.get_gid() == "rail"]
    np.testing.assert_allclose(rail.get_xdata()[[0, -1]], [states["nu"][0], 0.8], atol=1e-9)


def test_couples_turn_the_way_they_act():
    """The arc's head is where it ends, counterclockwise about the place for a positive couple."""
    for sign in (1.0, -1.0):
        rod = Rod(ends=("clamped", "free"), loads={"M": Couple(1.0)})
        states = lift(rod.natural_state(), {"M": 0.05 * sign}).states
        around = Surroundings(states)
        parts = around.moving_parts(Figure().add_subplot())
        (arc,) = [each for each in parts if each.artist.get_gid() == "load"]
        arc.place(-1)
        spokes = arc.artist.get_xydata()[:40] - states.shape()[-1, -1]
        turning = spokes[:-1, 0] * spokes[1:, 1] - spokes[:-1, 1] * spokes[1:, 0]
        assert (sign * turning > 0.0).all()


def _angles(vectors):
    return np.arctan2(*np.array(vectors).T[::-1])


def _route_of(path, descriptors):
    parameters = path.states.structure.parameters
    schedule = Schedule(
        names=names_of(parameters),
        roles=tuple(parameter.role for parameter in parameters),
        units=tuple(parameter.unit for parameter in parameters),
        values=path.states.p,
        progress=path.length / path.length[-1],
        margins=path.states.margin,
        descriptors=descriptors,
        start={},
        way_points=np.array([0, len(path.at) - 1]),
    )
    return Route("arrived", "", [], path, 1.0, 1.0, schedule)


def test_obstacles_of_constraints_are_hatched_where_they_forbid():
    """A disc, and the lower half-plane: one filled area each, with its edge."""
    arch = Rod()
    obstacles = (Disc((0.2, 0.4), 0.05), HalfPlane((0.0, -0.01), (0.0, 1.0)))
    within = [distance_to(arch, each) >= 0.0 for each in obstacles]
    assert obstacles_of([*within, arch.max_curvature <= 10]) == obstacles
    path = lift(arch.natural_state(Theta=0.9), {"Theta": 1.0})
    ax = plotting.shapes(path, count=2, obstacles=obstacles)
    areas = [each for each in ax.collections if isinstance(each, QuadContourSet) and each.filled]
    assert len(areas) == 2
    around = areas[0].get_paths()[0].vertices
    np.testing.assert_allclose(np.hypot(*(around - [0.2, 0.4]).T), 0.05, atol=2e-3)
