"""Derivatives of energies, and the promises that every structure makes, for every structure."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from equimorph.errors import InputError
from equimorph.linalg.determinants import in_units
from equimorph.structures import (
    KINDS,
    EnergyStructure,
    Frame,
    Rod,
    SpatialFrame,
    SpatialRod,
    Spring,
    Structure,
    from_identity,
    natural_state,
)
from equimorph.structures.equations import advance_by
from oracles.specimens import (
    SPECIMENS,
    arch_truss,
    closed_chain,
    portal,
    toggle,
    tripod,
    written_spring,
)

STEP = 1e-30
DRAWN = settings(max_examples=5, deadline=None, derandomize=True, database=None)
every_structure = pytest.mark.parametrize("specimen", SPECIMENS, ids=lambda each: each.name)
PINNED = "rod with a phase condition"
"""Its steps are those of the whole matrix at equilibria only: `test_orbits`."""
every_whole_step = pytest.mark.parametrize(
    "specimen", [each for each in SPECIMENS if each.name != PINNED], ids=lambda each: each.name
)


def drawn_states(test):
    """Try a test with random states of every structure."""
    return every_structure(given(seed=st.integers(0, 2**32 - 1))(DRAWN(test)))


def gradient(function, x):
    """Complex-step derivatives: exact to round-off [Squire and Trapp 1998]."""
    columns = []
    for i in range(x.shape[1]):
        moved = x.astype(complex)
        moved[:, i] += 1j * STEP
        columns.append(function(moved).imag / STEP)
    return np.stack(columns, axis=-1)


def differenced(function, step):
    """Central differences of fourth order in `step`."""
    return (8 * (function(step) - function(-step)) - (function(2 * step) - function(-2 * step))) / (
        12 * step
    )


def full_matrix(structure, z, p):
    """F_z by solving with unit vectors."""
    lanes, size = z.shape
    unit = np.broadcast_to(np.eye(size), (lanes, size, size)).copy()
    return np.linalg.inv(structure.solve(z, p, unit).x.transpose(0, 2, 1))


@drawn_states
def test_residual_is_the_gradient_of_the_lagrangian(specimen, seed):
    """Complex step of an independent L. 1e-12: sums of a hundred terms of order one."""
    structure = specimen.structure
    z, p, _, _ = specimen.states(seed=seed)
    exact = gradient(lambda at: specimen.lagrangian(at, p), z)
    np.testing.assert_allclose(structure.residual(z, p), exact, rtol=1e-11, atol=1e-12)


@drawn_states
def test_effort_is_the_derivative_by_the_parameters(specimen, seed):
    """Complex step of an independent L. 1e-12 as above."""
    structure = specimen.structure
    z, p, _, _ = specimen.states(seed=seed)
    exact = gradient(lambda at: specimen.lagrangian(z, at), p)
    np.testing.assert_allclose(structure.effort(z, p), exact, rtol=1e-11, atol=1e-12)


@drawn_states
def test_energy_is_the_lagrangian_without_its_constraints(specimen, seed):
    """L − λ·∂L/∂λ by complex step of an independent L; 1e-12 of its terms: round-off."""
    structure = specimen.structure
    z, p, _, _ = specimen.states(seed=seed)
    own, forces = z[:, : structure.unknowns], z[:, structure.unknowns :]

    def lagrangian(at):
        return specimen.lagrangian(np.concatenate([own, at], axis=1), p)

    exact = lagrangian(forces)
    if structure.constraints:
        exact = exact - (forces * gradient(lagrangian, forces)).sum(axis=1)
    np.testing.assert_allclose(structure.energy(z, p), exact, rtol=1e-12, atol=1e-12)


@drawn_states
def test_matrix_is_symmetric_and_the_derivative_of_the_residual(specimen, seed):
    """Central differences, step 1e-3: error 1e-12 of the fifth derivative, 1e-13 of round-off.

    Of the matrix, which is the inverse of solutions, round-off may be as large as its condition
    number says: a hundredth of that is allowed for where it is above a billionth.
    """
    structure = specimen.structure
    z, p, v, _ = specimen.states(seed=seed)
    matrix = full_matrix(structure, z, p)
    asymmetry = np.abs(matrix - matrix.transpose(0, 2, 1)).max(axis=(1, 2), initial=0.0)
    round_off = np.finfo(float).eps * np.linalg.cond(matrix)
    assert (asymmetry <= np.maximum(1e-9, 0.01 * round_off) * np.abs(matrix).max()).all()
    slope = differenced(lambda t: structure.residual(z + t * v, p), 1e-3)
    product = np.einsum("lij,lj->li", matrix, v)
    np.testing.assert_allclose(product, slope, rtol=1e-7, atol=1e-8 * np.abs(product).max())


@drawn_states
def test_parameter_derivative_is_that_of_the_residual(specimen, seed):
    """Central differences as above."""
    structure = specimen.structure
    z, p, _, dp = specimen.states(seed=seed)
    slope = differenced(lambda t: structure.residual(z, p + t * dp), 1e-3)
    found = structure.parameter_derivative(z, p, dp)
    np.testing.assert_allclose(found, slope, rtol=1e-8, atol=1e-9 * np.abs(slope).max())


@drawn_states
def test_second_derivative_is_that_of_the_residual_along_a_line(specimen, seed):
    """Second differences, step 1e-3, of fourth order: 1e-6 from round-off over step squared."""
    structure = specimen.structure
    z, p, dz, dp = specimen.states(seed=seed)

    def along(t):
        return structure.residual(z + t * dz, p + t * dp)

    h = 1e-3
    second = 16 * (along(h) + along(-h)) - (along(2 * h) + along(-2 * h)) - 30 * along(0.0)
    second /= 12 * h * h
    found = structure.second_derivative(z, p, (dz, dp), (dz, dp))
    np.testing.assert_allclose(found, second, rtol=1e-6, atol=1e-6 * np.abs(second).max())


@drawn_states
def test_second_derivative_is_bilinear_and_symmetric(specimen, seed):
    """Polarisation: 4 B(v, w) = B(v+w, v+w) − B(v−w, v−w). 1e-12: round-off."""
    structure = specimen.structure
    z, p, dz, dp = specimen.states(seed=seed)
    _, _, ez, ep = specimen.states(seed=seed + 1)

    def square(sign):
        both = (dz + sign * ez, dp + sign * ep)
        return structure.second_derivative(z, p, both, both)

    mixed = structure.second_derivative(z, p, (dz, dp), (ez, ep))
    swapped = structure.second_derivative(z, p, (ez, ep), (dz, dp))
    scale = np.abs(mixed).max()
    np.testing.assert_allclose(mixed, swapped, atol=1e-13 * scale)
    np.testing.assert_allclose(4 * mixed, square(1.0) - square(-1.0), atol=1e-12 * scale)


@every_whole_step
def test_fused_step_equals_the_plain_route(specimen):
    """`Structure.advance` by the general bordered solve. 1e-10: conditioning of random states."""
    structure = specimen.structure
    for lanes in (1, 5, 8, 21):
        z, p, row, dp = specimen.states(lanes)
        generator = np.random.default_rng(2)
        corner, defect = generator.normal(size=lanes), generator.normal(size=lanes)
        fused = structure.advance(z, p, dp, row, corner, defect)
        parts = Structure.linear_system(structure, z, p, dp[:, None])
        plain = advance_by(parts, row, corner, defect, structure.constraints)
        np.testing.assert_array_equal(fused.index, plain.index)
        for name in ("dz", "dt", "tangent_z", "tangent_t", "residual"):
            exact = getattr(plain, name)
            bound = 1e-10 * max(1.0, np.abs(exact).max())
            np.testing.assert_allclose(getattr(fused, name), exact, rtol=1e-9, atol=bound)


@every_whole_step
@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_response_is_the_step_at_fixed_parameters_with_tangents(specimen, k):
    """Solves with −F and −F_p·d of each direction. 1e-10: conditioning of random states."""
    structure = specimen.structure
    for lanes in (1, 5, 8, 21):
        z, p, _, dp = specimen.states(lanes)
        directions = np.stack([dp, dp[::-1] - 0.3 * dp, 0.2 * dp[::-1], 2.0 * dp], axis=1)[:, :k]
        found = structure.respond(z, p, directions)
        system = structure.linear_system(z, p, directions)
        rhs = -np.concatenate([system.residual[:, None], system.columns], axis=1)
        exact = structure.solve(z, p, rhs)
        np.testing.assert_array_equal(found.index, exact.negative - structure.constraints)
        np.testing.assert_array_equal(found.index, structure.index(z, p))
        steps = np.concatenate([found.dz[:, None], found.tangents], axis=1)
        bound = 1e-10 * max(1.0, np.abs(exact.x).max())
        np.testing.assert_allclose(steps, exact.x, rtol=1e-9, atol=bound)
        row, one, none = np.zeros_like(z), np.ones(lanes), np.zeros(lanes)
        step = structure.advance(z, p, dp, row, one, none)
        told, known = (in_units(each.determinant, 0.0) for each in (found, step))
        np.testing.assert_allclose(told, known, rtol=1e-10)


@every_structure
@pytest.mark.parametrize("k", [0, 1, 2])
def test_linear_system_is_what_its_parts_are(specimen, k):
    """`residual`, `parameter_derivative` and `solve`, with and without a border."""
    structure = specimen.structure
    for lanes in (1, 5, 21):
        z, p, row, dp = specimen.states(lanes)
        directions = np.stack([dp, dp[::-1] - 0.3 * dp], axis=1)[:, :k]
        system = structure.linear_system(z, p, directions)
        np.testing.assert_allclose(system.residual, structure.residual(z, p), atol=1e-12)
        assert system.columns.shape == (lanes, k, structure.size)
        for i in range(k):
            column = structure.parameter_derivative(z, p, np.ascontiguousarray(directions[:, i]))
            np.testing.assert_allclose(system.columns[:, i], column, atol=1e-12)
        corner = np.full((lanes, 1, 1), 0.7)
        for border in (None, (row[:, None], row[:, None], corner)):
            rhs = np.ones((lanes, 2, structure.size + (border is not None)))
            found, exact = system.solve(rhs, border), structure.solve(z, p, rhs, border)
            np.testing.assert_array_equal(found.negative, exact.negative)
            bound = 1e-10 * max(1.0, np.abs(exact.x).max())
            np.testing.assert_allclose(found.x, exact.x, rtol=1e-9, atol=bound)


@every_whole_step
def test_determinant_that_the_fused_step_tells_is_that_of_the_matrix(specimen):
    """Inverse by as many solves as columns, of every structure. 1e-8: the condition."""
    structure = specimen.structure
    z, p, row, dp = specimen.states(8, seed=3)
    one = np.ones(8)
    told = in_units(structure.advance(z, p, dp, row, one, one).determinant, 0.0)
    inverse = structure.solve(z, p, np.tile(np.eye(structure.size), (8, 1, 1))).x
    assert told == pytest.approx(1.0 / np.linalg.det(inverse), rel=1e-8)


@every_structure
def test_a_lane_that_is_no_number_leaves_the_other_steps_alone(specimen):
    structure = specimen.structure
    z, p, row, dp = specimen.states(9)
    one, none = np.ones(9), np.zeros(9)
    clean = structure.advance(z, p, dp, row, one, none)
    z = z.copy()
    z[4] = np.nan
    dirty = structure.advance(z, p, dp, row, one, none)
    others = np.arange(9) != 4
    np.testing.assert_array_equal(dirty.dz[others], clean.dz[others])
    np.testing.assert_array_equal(dirty.index[others], clean.index[others])
    assert np.isnan(dirty.dz[4]).all()
    assert np.isnan(dirty.residual[4])


@every_structure
def test_symmetries_map_residuals_to_residuals(specimen):
    """|F| is the same at the image, and the symmetry is an involution. 1e-12: round-off."""
    structure = specimen.structure
    z, p, _, _ = specimen.states()
    for symmetry in structure.symmetries():
        image_z, image_p = symmetry.apply(z, p)
        np.testing.assert_allclose(image_p, symmetry.image(p), rtol=1e-15)
        here = np.abs(structure.residual(z, p))
        there = np.abs(structure.residual(image_z, image_p))
        if isinstance(
            structure, Rod | SpatialRod | Frame | SpatialFrame
        ):  # most of them turn it round
            here, there = np.sort(here, axis=1), np.sort(there, axis=1)
        np.testing.assert_allclose(there, here, atol=1e-12)
        back_z, back_p = symmetry.apply(image_z, image_p)
        np.testing.assert_allclose(back_z, z, atol=1e-14)
        np.testing.assert_allclose(back_p, p, atol=1e-15)


@every_structure
def test_drawing_has_places_and_unit_directions_for_every_lane(specimen):
    """The same things in the same order for any batch."""
    structure = specimen.structure
    z, p, _, _ = specimen.states(5)
    shape, whole = structure.shape(z, p), structure.drawing(z, p)
    space, part = shape.shape[2], structure.drawing(z[2:3], p[2:3])
    groups = ("supports", "forces", "couples", "actuators")
    assert [len(getattr(part, name)) for name in groups] == [
        len(getattr(whole, name)) for name in groups
    ]
    for one, all_lanes in zip(part.supports, whole.supports, strict=True):
        assert one.kind is all_lanes.kind
        np.testing.assert_allclose(one.places, all_lanes.places[2:3], atol=1e-13)
        sizes = np.linalg.norm(all_lanes.directions, axis=1)
        np.testing.assert_allclose(sizes, 1.0, rtol=1e-12)
    for each in whole.forces:
        assert each.places.shape == each.vectors.shape == (5, each.places.shape[1], space)
        assert np.isfinite(each.vectors).all()
    for each in whole.couples:
        assert each.places.shape == (*each.moments.shape, space)
    for each in whole.actuators:
        assert np.isfinite(each.line).all()


@every_structure
def test_supports_and_forces_are_drawn_on_the_shape(specimen):
    """In natural states, whose members meet. A frame draws 17 places a member, a rod 101."""
    structure = specimen.structure
    p = np.array([specimen.centre])
    for k, each in enumerate(structure.parameters):
        p[:, k] = 0.0 if each.role == "load" else p[:, k]
    z, found = structure.natural(p)
    if not found.all():
        p = np.array([[each.default or 0.0 for each in structure.parameters]])
        z, found = structure.natural(p)
    assert found.all()
    shape, drawing = structure.shape(z, p)[0], structure.drawing(z, p)
    for each in drawing.supports:
        assert np.linalg.norm(shape - each.places[0], axis=1).min() < 1e-9
    spacing = np.linalg.norm(np.diff(shape, axis=0), axis=1).max()
    for each in drawing.forces:
        for place in each.places[0]:
            assert np.linalg.norm(shape - place, axis=1).min() <= 0.51 * spacing


@every_structure
def test_a_drawing_shows_every_load(specimen):
    """Forces and couples are proportional to loads, so that none are left at p = 0."""
    structure = specimen.structure
    z, p, _, _ = specimen.states(3)
    loads = [k for k, each in enumerate(structure.parameters) if each.role == "load"]
    if isinstance(structure, EnergyStructure):  # its author may leave them out
        return
    for k in loads:
        alone = np.zeros_like(p)
        alone[:, k] = p[:, k]
        drawn = structure.drawing(z, alone)
        sizes = [np.abs(each.vectors).max() for each in drawn.forces]
        sizes += [np.abs(each.moments).max() for each in drawn.couples]
        name = structure.parameters[k].name
        assert max(sizes, default=0.0) > 0.0, f"`drawing` must show the load {name}"
    bare = structure.drawing(z, np.zeros_like(p))
    assert not any(each.vectors.any() for each in bare.forces)
    assert not any(each.moments.any() for each in bare.couples)


@every_structure
def test_energy_is_a_descriptor_of_every_structure(specimen):
    """Reports show it for every state, in the units of the parameters. 1e-14: round-off."""
    structure = specimen.structure
    z, p, _, _ = specimen.states()
    told = structure.descriptor("energy").function(z, p)
    exact = structure.energy_scale * structure.energy(z, p)
    np.testing.assert_allclose(told, exact, rtol=1e-14)


@every_structure
def test_every_structure_is_rebuilt_from_its_identity(specimen):
    """Bit for bit; a kind that is missing in `KINDS` is refused here."""
    structure = specimen.structure
    again = from_identity(structure.identity())
    z, p, _, _ = specimen.states()
    np.testing.assert_array_equal(again.residual(z, p), structure.residual(z, p))
    assert again.identity() == structure.identity()


def test_only_a_symmetric_load_has_the_mirror():
    assert [s.name for s in Rod("uniform").symmetries()] == ["mirror"]
    assert Rod("left-half").symmetries() == ()
    assert [s.name for s in Spring().symmetries()] == ["mirror"]


@pytest.mark.parametrize(
    "made",
    [
        Rod(),
        Rod("left-half", 0.7, elements=6, degree=5),
        Rod([[0.0, 1.0], [0.3, 1.0], [0.3, 0.0], [1.0, 2.0]]),
        Spring(2.0),
        written_spring(),
        closed_chain(),
        arch_truss("green"),
        tripod(),
        portal(None),
        toggle(),
    ],
    ids=[
        *("default", "resolution", "table", "spring", "energy", "constraints", "truss", "space"),
        *("frame", "toggle"),
    ],
)
def test_a_structure_is_rebuilt_from_its_identity(made):
    """Bit for bit: the identity is data."""
    again = from_identity(made.identity())
    generator = np.random.default_rng(0)
    p = np.array([[parameter.default or 0.5 for parameter in made.parameters]])
    z = made.sample(p, generator)
    np.testing.assert_array_equal(again.residual(z, p), made.residual(z, p))
    assert again.identity() == made.identity()


@pytest.mark.parametrize(
    ("made", "values"),
    [
        (Rod(), {"Theta": 0.9, "Delta": 0.1}),
        (Spring(), {"x_l": 0.8}),
        (arch_truss("green"), {}),
        (toggle(), {}),
    ],
    ids=["rod", "spring", "truss", "frame"],
)
def test_every_structure_has_a_natural_state_by_the_contract_alone(made, values):
    """As by the method that the structures offer; loads are refused."""
    state = natural_state(made, **values)
    assert state.residual < 1e-10
    assert state.structure is made
    np.testing.assert_array_equal(state.z, made.natural_state(**values).z)
    load = next(iter(made.unloaded()))
    with pytest.raises(InputError, match=f"`{load}` must be 0 in the natural state; got 1"):
        natural_state(made, **values, **{load: 1.0})


def test_a_natural_state_that_is_not_found_is_refused():
    with pytest.raises(InputError, match="`rod` must have a natural state; none is found at Theta"):
        natural_state(Rod(), Theta=-0.5, Delta=0.0)


@pytest.mark.parametrize(
    ("identity", "text"),
    [
        ({"kind": "plate"}, f"`kind` must be one of {', '.join(KINDS)}; got 'plate'"),
        ({}, f"`kind` must be one of {', '.join(KINDS)}; got None"),
        ({"kind": "rod", "colour": "red"}, "`Rod` must have arguments among load, .*; got colour"),
    ],
)
def test_a_wrong_identity_is_refused(identity, text):
    with pytest.raises(InputError, match=text):
        from_identity(identity)
