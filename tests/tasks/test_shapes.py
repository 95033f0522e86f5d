"""Inverse kinematics: the spring against its closed form, the arch against PHYSICS §4.6."""

import numpy as np
import pytest

import equimorph as em
import sets
from equimorph.errors import InputError
from equimorph.manifold import part
from equimorph.structures import State, States
from typecheck import unchecked

ANGLE, FORCE = 0.62, 0.009908


@pytest.fixture(scope="module")
def support():
    """Descriptor that is not a function of δ alone: the length of the spring, x_l / cos δ."""
    return em.Descriptor("length", "1", lambda z, p: p[:, 0] / np.cos(z[:, 0]))


def test_spring_takes_every_angle_and_length_once(spring_set, support):
    """δ and ℓ fix x_l = ℓ cos δ and F = (1 − ℓ) sin δ: one state, also close to folds."""
    angle = spring_set.structure.descriptor("angle")
    generator = np.random.default_rng(3)
    for delta, length in generator.uniform((-0.8, 0.5), (0.8, 1.2), (40, 2)):
        x, force = length * np.cos(delta), (1 - length) * np.sin(delta)
        if not (0.3 < x < 1.3 and abs(force) < 0.5):
            continue
        found = em.solve_shape(spring_set, {angle: delta, support: length})
        assert found.solved
        assert len(found) == 1
        assert found.states.p[0, :2] == pytest.approx([x, force], abs=1e-10)
        assert found.index[0] == (0 if x > np.cos(delta) ** 3 else 1)


def test_both_states_at_one_height_and_width_of_the_arch(arch_set):
    """Stable at Θ = 1.621098, Δ = 0; every solution is confirmed by its descriptors."""
    arch = arch_set.structure
    left, right = arch.height(1 / 3), arch.height(2 / 3)
    found = em.solve_shape(arch_set, {left: 0.15, right: 0.15})
    assert found.solved
    assert found.stable[0]["Theta"] == pytest.approx(1.621098, abs=5e-7)
    assert found.stable[0]["Delta"] == pytest.approx(0.0, abs=1e-9)
    for height in (left, right):
        assert height(found.states) == pytest.approx(0.15, abs=1e-10)
    assert (found.states.residual < 1e-9).all()
    assert (np.diff(found.index) >= 0).all()
    assert (found.margin[found.index == 0] > 0).all()


def test_solutions_on_a_part_are_those_of_the_set_that_lie_on_it(arch_set):
    """Strata share all solutions: of 135 from the cells of one, 13 lay on others."""
    arch, generator = arch_set.structure, np.random.default_rng(3)
    heights = arch.height(1 / 3), arch.height(2 / 3)
    some = arch_set.points[generator.integers(len(arch_set.points), size=40)]
    targets = {each: each(some) + generator.normal(0.0, 0.002, 40) for each in heights}
    parts = [
        em.solve_shapes(part(arch_set, arch_set.stratum == number), targets)
        for number in range(int(arch_set.stratum.max()) + 1)
    ]
    for whole, *shared in zip(em.solve_shapes(arch_set, targets), *parts, strict=True):
        found = np.concatenate([each.states.z for each in shared])
        assert len(found) == len(whole.states)
        gap = np.linalg.norm(whole.states.z[:, None] - found, axis=2)
        assert (gap.min(axis=1, initial=np.inf) < 1e-7).all()


def test_solutions_are_ranked_by_the_routes_from_a_start(arch_set, ends):
    arch = arch_set.structure
    upright, _ = ends
    targets = {arch.height(1 / 3): 0.15, arch.height(2 / 3): 0.15}
    found = em.solve_shape(arch_set, targets, start=upright)
    assert len(found.routes) == len(found)
    assert found.routes[0].arrived
    lengths = [route.length for route in found.routes if route.arrived]
    assert lengths == sorted(lengths)
    by_margin = em.solve_shape(arch_set, targets, rank="margin")
    assert (np.diff(by_margin.margin[by_margin.index == 0]) <= 0).all()


def test_what_no_shape_has_is_refused_with_the_nearest_vertex(arch_set):
    arch = arch_set.structure
    found = em.solve_shape(arch_set, {arch.height(1 / 3): 0.3, arch.height(2 / 3): 0.3})
    assert (found.status, len(found)) == ("refused", 0)
    assert found.why.startswith("no state of the set has height")
    assert isinstance(found.closest, State)
    assert min(found.miss.values()) < 0


def test_constraints_take_solutions_away(arch_set):
    arch = arch_set.structure
    targets = {arch.height(1 / 3): 0.15, arch.height(2 / 3): 0.15}
    bound = float(arch.max_curvature(em.solve_shape(arch_set, targets).states[0]))
    assert em.solve_shape(arch_set, targets, within=[arch.max_curvature <= bound + 0.1]).solved
    tight = em.solve_shape(arch_set, targets, within=[arch.max_curvature <= bound - 0.1])
    assert (tight.status, len(tight)) == ("refused", 0)


def test_every_state_is_found_by_its_heights(arch_set):
    """All equilibria over random points of the plane, stable and unstable ones on both pieces."""
    arch = arch_set.structure
    heights = arch.height(1 / 3), arch.height(2 / 3)
    generator = np.random.default_rng(5)
    for theta, delta in generator.uniform(arch_set.box.lower, arch_set.box.upper, (6, 2)):
        for state in arch_set.at(Theta=theta, Delta=delta):
            found = em.solve_shape(arch_set, {each: each(state) for each in heights})
            gaps = np.abs(found.states.p - state.p).max(axis=1)
            assert gaps.min() < 1e-7, state


def independent_roots(arch, descriptors, wanted, near):
    """Newton on (F, S − S*) in all unknowns and both actuators, from states, by dense algebra."""
    size, found = arch.size, []
    for z, p in zip(near.z, near.p, strict=True):
        x = np.concatenate([z, p[:2]])
        for _ in range(12):
            lanes = x + 1e-6 * np.concatenate([np.eye(size + 2), -np.eye(size + 2)])
            many = np.concatenate([x[None], lanes])
            full = np.tile(p, (len(many), 1))
            full[:, :2] = many[:, size:]
            states = np.ascontiguousarray(many[:, :size])
            values = [each.function(states, full) for each in descriptors]
            rest = np.column_stack([arch.residual(states, full), *values])
            rest[:, size:] -= wanted
            slopes = (rest[1 : size + 3] - rest[size + 3 :]).T / 2e-6
            step = np.linalg.solve(slopes, -rest[0])
            x = x + step * min(1.0, 0.5 / np.abs(step).max())
            if np.abs(step).max() < 1e-9:
                found.append(x)
                break
    return found


def test_targets_have_the_solutions_that_brute_force_finds(arch_set):
    """24 of the 200 targets of the slow test."""
    check_against_roots(arch_set, random_heights(arch_set, 24))


@pytest.mark.slow
def test_two_hundred_targets_have_the_solutions_that_brute_force_finds(arch_set):
    """Newton from every vertex nearby finds no solution that is not among the answers."""
    assert check_against_roots(arch_set, random_heights(arch_set, 200)) >= 300


def random_heights(arch_set, count):
    """Heights of random vertices, and a little beside them."""
    heights = (arch_set.structure.height(s) for s in (1 / 3, 2 / 3))
    values = np.stack([each(arch_set.points) for each in heights], axis=1)
    generator = np.random.default_rng(11)
    picked = generator.choice(len(values), count)
    return values[picked] + generator.normal(0, 3e-3, (count, 2))


def check_against_roots(arch_set, wanted):
    """Compare all answers with roots from vertices nearby; number of solutions."""
    arch, names = arch_set.structure, ("Theta", "Delta")
    heights = arch.height(1 / 3), arch.height(2 / 3)
    values = np.stack([each(arch_set.points) for each in heights], axis=1)
    answers = em.solve_shapes(arch_set, dict(zip(heights, wanted.T, strict=True)))
    total = 0
    for target, answer in zip(wanted, answers, strict=True):
        near = np.argsort(np.hypot(*(values - target).T))[:12]
        places = np.stack([answer.states[name] for name in names], axis=1)
        for each in heights:
            aim = target[heights.index(each)]
            assert each(answer.states) == pytest.approx(aim, abs=1e-10) if len(answer) else True
        with unchecked():
            roots = independent_roots(arch, heights, target, arch_set.points[near])
        for x in roots:
            z, p = x[None, : arch.size].copy(), arch_set.points.p[:1].copy()
            p[0, :2] = x[arch.size :]
            if not arch_set.box.contains(p[0, :2]) or not arch.resolved(z, p)[0]:
                continue
            if arch.max_curvature.function(z, p)[0] > 20:
                continue
            assert len(places)
            assert np.abs(places - p[0, :2]).max(axis=1).min() < 1e-7
        total += len(answer)
    return total


@pytest.mark.slow
def test_solutions_beside_a_singular_map_have_their_twins(arch_set):
    """Vertices at which the sense of the map to the heights changes: one of two was missing."""
    cells, points = arch_set.cells[arch_set.cell_index == 0], arch_set.points
    arch = arch_set.structure
    values = np.stack([arch.height(s)(points) for s in (1 / 3, 2 / 3)], axis=1)
    places = np.stack([points["Theta"], points["Delta"]], axis=1)
    sides = (np.linalg.det(each[cells[:, 1:]] - each[cells[:, :1]]) for each in (values, places))
    sense = np.sign(np.prod(list(sides), axis=0))
    edge = np.intersect1d(cells[sense > 0], cells[sense < 0])
    edge = edge[arch_set.kinds[edge] == 0]
    assert check_against_roots(arch_set, values[edge]) > 1.5 * len(edge)


@pytest.mark.slow
def test_three_hundred_targets_with_several_stable_states_have_them_all(arch_set):
    """Stable states of a set sixteen times as fine whose heights other cells of it have, too.

    Newton from the corners of these cells is the oracle; of 305 such targets 7 lacked a state.
    """
    arch, fine = arch_set.structure, sets.arch_set((47, 81))
    heights = arch.height(1 / 3), arch.height(2 / 3)
    values = np.stack([each(fine.points) for each in heights], axis=1)
    cells = fine.cells[fine.cell_index == 0]
    targets, near = [], []
    stable = np.flatnonzero((fine.points.index == 0) & (fine.kinds == 0))
    for vertex in np.random.default_rng(16).permutation(stable):
        a, b, c = (values[cells[:, k]] - values[vertex] for k in range(3))
        turns = np.stack(
            [u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] for u, v in ((a, b), (b, c), (c, a))]
        )
        over = cells[(turns >= 0).all(axis=0) | (turns <= 0).all(axis=0)]
        if (over != vertex).all(axis=1).any():
            targets.append(values[vertex])
            near.append(np.unique(np.append(over, vertex)))
    wanted = np.array(targets)
    answers = em.solve_shapes(arch_set, dict(zip(heights, wanted.T, strict=True)))
    several = 0
    for target, at, answer in zip(wanted, near, answers, strict=True):
        with unchecked():
            roots = np.array(independent_roots(arch, heights, target, fine.points[at]))
        z, p = roots[:, : arch.size].copy(), np.tile(fine.points.p[:1], (len(roots), 1))
        p[:, :2] = roots[:, arch.size :]
        good = (States(arch, z, p).index == 0) & arch_set.box.contains(p[:, :2])
        good &= arch.resolved(z, p) & (arch.max_curvature.function(z, p) <= 20.0)
        places = np.unique(p[good, :2].round(7), axis=0)
        gaps = np.abs(answer.states.p[None, :, :2] - p[good][:, None, :2]).max(axis=2)
        assert gaps.min(axis=1).max(initial=0.0) < 1e-7, target
        several += len(places) > 1
    assert several >= 305


def test_twins_of_solutions_beside_a_singular_map_are_found(arch_set):
    """Pairs of stable states of equal heights on both sides of det J_S = 0, from a finer set."""
    arch = arch_set.structure
    heights = arch.height(1 / 3), arch.height(2 / 3)
    for theta, delta in ((0.739, -0.176), (0.884, 1.011), (0.676, -0.164)):
        state = next(
            each
            for each in arch_set.at(Theta=theta, Delta=delta).stable
            if len(em.solve_shape(arch_set, {h: h(each) for h in heights}).stable) > 1
        )
        answer = em.solve_shape(arch_set, {each: each(state) for each in heights})
        assert len(answer.stable) == 2


@pytest.mark.parametrize(
    ("place", "other"),
    [((0.72017, -0.19016), 2 / 3), ((0.61459, -0.16419), 1 / 2), ((0.6989, -0.1362), 1 / 2)],
)
def test_states_of_a_coarse_set_are_solutions_of_their_own_values(place, other):
    """Height and Δ of stable states beside det J_S = 0: 24 of 17 800 such states were missing."""
    eset = sets.arch_set((9, 14))
    height, delta = eset.structure.height(other), em.value_of(eset.structure, "Delta")
    for state in eset.at(Theta=place[0], Delta=place[1]).stable:
        found = em.solve_shape(eset, {height: height(state), delta: place[1]})
        assert np.abs(found.states.p - state.p).max(axis=1).min() < 1e-7


def test_more_targets_than_actuators_are_fitted(arch_set):
    """Targets of a state are met exactly; others leave a misfit that no state nearby beats."""
    arch = arch_set.structure
    heights = [arch.height(s) for s in (1 / 3, 1 / 2, 2 / 3)]
    state = max(arch_set.at(Theta=1.1, Delta=0.3).stable, key=arch.height(0.5))
    exact = em.solve_shape(arch_set, {each: each(state) for each in heights})
    assert exact.status == "solved"
    assert exact.misfit[0] < 1e-8
    assert exact.states.p[0] == pytest.approx(state.p, abs=1e-6)
    wanted = (0.15, 0.17, 0.16)
    fits = em.solve_shape(arch_set, dict(zip(heights, wanted, strict=True)))
    assert fits.status == "fitted"
    assert (np.diff(fits.misfit) >= -1e-12).all()
    spread = np.array([np.ptp(each(arch_set.points)) for each in heights])

    def misfit(state):
        return np.linalg.norm((np.array([h(state) for h in heights]) - wanted) / spread)

    best = fits.states[0]
    assert misfit(best) == pytest.approx(fits.misfit[0], abs=1e-10)
    for step in np.random.default_rng(1).normal(0, 1e-3, (8, 2)):
        at = {"Theta": best["Theta"] + step[0], "Delta": best["Delta"] + step[1]}
        assert misfit(em.lift(best, at).end.state) > fits.misfit[0]


def test_fewer_targets_than_actuators_leave_a_family(arch_set):
    """All states with y(½) = 0.17: curves, exact at their vertices, through every solution."""
    arch = arch_set.structure
    rise = arch.height(0.5)
    found = em.solve_shape(arch_set, {rise: 0.17})
    assert found.solved
    assert rise(found.states) == pytest.approx(0.17, abs=1e-10)
    family = found.family
    assert family is not None
    assert rise(family.states) == pytest.approx(0.17, abs=1e-10)
    assert sum(map(len, family.pieces)) > 20
    square = em.solve_shape(arch_set, {rise: 0.17, arch.height(1 / 3): 0.15})
    assert square.family is None


def test_the_nearest_state_to_what_cannot_be_reached_is_exact(arch_set):
    """No stable neighbour of it comes nearer."""
    arch = arch_set.structure
    heights = arch.height(1 / 3), arch.height(2 / 3)
    found = em.solve_shape(arch_set, dict.fromkeys(heights, 0.3))
    nearest = found.nearest
    assert nearest is not None
    spread = [np.ptp(each(arch_set.points)) for each in heights]

    def gap(state):
        return np.hypot(*((each(state) - 0.3) / s for each, s in zip(heights, spread, strict=True)))

    assert gap(nearest) < gap(found.closest) + 1e-12
    for step in np.random.default_rng(1).normal(0, 1e-3, (8, 2)):
        at = {"Theta": nearest["Theta"] + step[0], "Delta": nearest["Delta"] + step[1]}
        assert gap(em.lift(nearest, at).end.state) > gap(nearest)


@pytest.fixture(scope="module")
def arm_set():
    """Soft arm of three segments, upright under half a unit at its tip, over all of them."""
    segments = {f"k{i + 1}": em.Curvature(1.0, i / 3, (i + 1) / 3) for i in range(3)}
    arm = em.Rod(
        ends=("clamped", "free"),
        actuators=segments,
        loads={"P": em.PointForce(1.0)},
        EI=1.0,
        length=1.0,
        elements=3,
        degree=7,
    )
    box = em.Box(k1=(-1.5, 1.5), k2=(-1.5, 1.5), k3=(-1.5, 1.5))
    with unchecked():
        return em.equilibrium_set(
            arm, box, fixed={"theta_A": np.pi / 2, "P": 0.5}, intervals=(4, 4, 4), checks=0
        )


def reached(arm_set, count):
    """Random tips with their angles are all met, by the very settings that they come from."""
    arm = arm_set.structure
    pose = (*arm.position(1.0), arm.angle(1.0))
    k = np.random.default_rng(1).uniform(-1.4, 1.4, (count, 3))
    with unchecked():
        tips = arm_set.over(k1=k[:, 0], k2=k[:, 1], k3=k[:, 2]).states
        answers = em.solve_shapes(arm_set, {each: each(tips) for each in pose})
        places = em.solve_shapes(arm_set, {each: each(tips).tolist() for each in pose[:2]})
    assert len(tips) == count
    for number, (answer, place) in enumerate(zip(answers, places, strict=True)):
        assert answer.solved
        assert np.abs(answer.states.p - tips.p[number]).max(axis=1).min() < 1e-9
        assert (answer.states.residual < 1e-8).all()
        assert place.solved
        for each in pose[:2]:
            assert each(place.states) == pytest.approx(each(tips[number]), abs=1e-8)
            assert each(answer.states) == pytest.approx(each(tips[number]), abs=1e-9)


def test_an_arm_reaches_random_tips(arm_set):
    reached(arm_set, 25)


@pytest.mark.slow
def test_an_arm_reaches_five_hundred_random_tips(arm_set):
    reached(arm_set, 500)


def test_three_segments_leave_a_curve_of_ways_to_one_tip(arm_set):
    """The curve is closed; the gentlest way to the tip, by optimisation, lies on it."""
    arm = arm_set.structure
    x, y = arm.position(1.0)
    bends = [em.value_of(arm, f"k{i}") for i in (1, 2, 3)]
    effort = em.function_of("effort", lambda a, b, c: a**2 + b**2 + c**2, *bends)
    there = arm_set.at(k1=-0.6, k2=0.3, k3=-0.9)[0]
    goal = {x: x(there), y: y(there)}
    with unchecked():
        family = em.solve_shape(arm_set, goal).family
        on_it = [bound for each, v in goal.items() for bound in (each <= v, each >= v)]
        best = em.optimise(arm_set, effort, within=on_it).best
    assert family.lost == 0
    [curve] = family.pieces
    assert curve[0] == curve[-1]
    for each, value in goal.items():
        assert each(family.states) == pytest.approx(value, abs=1e-10)
        assert each(best.state) == pytest.approx(value, abs=1e-8)
    lengths = np.linalg.norm(np.diff(family.states.p[curve, 1:4], axis=0), axis=1)
    assert best.value <= effort(family.states).min()
    assert best.value >= effort(family.states).min() - 2 * lengths.max()
    assert best.certificate.residual < 1e-7


def test_what_an_arm_cannot_reach_is_refused_with_the_nearest_tip(arm_set):
    """A tip beyond the length of the arm; the nearest one lies on a side of the box."""
    arm = arm_set.structure
    x, y = arm.position(1.0)
    with unchecked():
        found = em.solve_shape(arm_set, {x: 0.9, y: 0.9})
        nearest = found.nearest
    assert found.status == "refused"
    assert "no state of the set has x(1) = 0.9, height(1) = 0.9" in found.why
    assert nearest["k1"] == pytest.approx(-1.5)
    grid = np.linspace(-1.5, 1.5, 15)
    k2, k3 = (each.ravel() for each in np.meshgrid(grid, grid))
    edge = arm_set.over(k1=np.full(k2.shape, -1.5), k2=k2, k3=k3).states
    spread = [np.ptp(each(arm_set.points)) for each in (x, y)]
    gap = np.hypot((x(edge) - 0.9) / spread[0], (y(edge) - 0.9) / spread[1])
    own = np.hypot((x(nearest) - 0.9) / spread[0], (y(nearest) - 0.9) / spread[1])
    assert own <= gap.min() + 1e-12
    assert own == pytest.approx(gap.min(), abs=5e-3)


def test_bad_questions_are_refused(spring_set):
    angle = spring_set.structure.descriptor("angle")
    energy = spring_set.structure.descriptor("energy")
    with pytest.raises(InputError, match="at least one descriptor; got none"):
        em.solve_shape(spring_set, {})
    with pytest.raises(InputError, match="equally many values"):
        em.solve_shapes(spring_set, {angle: np.ones(2), energy: np.ones(3)})
    with pytest.raises(InputError, match="got energy = nan"):
        em.solve_shape(spring_set, {angle: 0.1, energy: np.nan})
    with pytest.raises(InputError, match="route if there is a start"):
        em.solve_shape(spring_set, {angle: 0.1, energy: 0.1}, rank="route")
