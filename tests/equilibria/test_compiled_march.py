"""The loops that a rod compiles as a whole do what the general ones do, bit for bit."""

from dataclasses import fields

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import ParameterLine, TraceOptions, Traces, trace
from equimorph.equilibria.curves import growing_force, newton_homotopy
from equimorph.equilibria.rare_steps import RareSteps
from equimorph.equilibria.trace import Batching
from equimorph.equilibria.trace_options import EventCode
from equimorph.errors import InputError
from equimorph.structures import Advance, Equations, States
from equimorph.structures.rod import Rod


@pytest.fixture(scope="module")
def starts() -> States:
    """Natural states of the arch with their loads."""
    arch, generator = em.Rod(load="uniform"), np.random.default_rng(5)
    p = np.zeros((400, 4))
    p[:, 0], p[:, 1] = generator.uniform(0.2, 2.5, len(p)), generator.uniform(-2.0, 2.0, len(p))
    p[:, 3] = np.sin(1.0)
    states, found = arch.natural_states(p)
    states = states[np.flatnonzero(found)]
    return states[np.flatnonzero(arch.max_curvature(states) <= 10)]


def _traced(starts: States, count: int, bounds: tuple[float, ...], **options: object) -> Traces:
    arch, some = starts.structure, starts[np.arange(count)]
    within = [arch.max_curvature <= bound for bound in bounds[:1]]
    within += [arch.max_curvature >= bound for bound in bounds[1:]]
    curve = ParameterLine(arch, some.p, np.tile([0.1, 0.0, 20.0, 0.0], (count, 1)))
    return trace(curve, some.z, tuple(within), TraceOptions(**options))


def _columns(record: object) -> list[np.ndarray]:
    columns = []
    for each in (getattr(record, field.name) for field in fields(record)):
        if isinstance(each, np.ndarray):
            columns.append(each)
        elif hasattr(each, "__dataclass_fields__"):
            columns += _columns(each)
    return columns


THROUGH = {"through_folds": True, "through_branch_points": True}


@pytest.mark.parametrize(
    ("count", "bounds", "options"),
    [
        (1, (), {}),
        (1, (10.0,), {"largest_step": 0.02}),
        (7, (10.0,), {}),
        (40, (10.0, 2.5), {"record": False}),
        (40, (), THROUGH),
        (40, (20.0,), {**THROUGH, "largest_step": 0.1}),
        (133, (10.0,), {"record": False}),
    ],
)
def test_compiled_loops_equal_the_general_ones(
    starts: States,
    count: int,
    bounds: tuple[float, ...],
    options: dict[str, object],
    monkeypatch: pytest.MonkeyPatch,
):
    """Ends, points and events passed are the same numbers: the same kernels in the same order."""
    compiled = _traced(starts, count, bounds, **options)
    monkeypatch.setattr(Rod, "compiled_steps", lambda *_: None)
    general = _traced(starts, count, bounds, **options)
    assert compiled.why == general.why
    for one, other in zip(_columns(compiled), _columns(general), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("count", [1, 5, 40])
def test_compiled_loops_under_forces_equal_the_general_ones(
    starts: States, count: int, monkeypatch: pytest.MonkeyPatch
):
    """Homotopies from random guesses, and pushes from states through folds."""
    arch, some = starts.structure, starts[np.arange(count)]
    guess = arch.sample(some.p, np.random.default_rng(3))
    force = np.zeros_like(some.z)
    force[:, : arch.unknowns] = 3.0 * np.random.default_rng(4).normal(size=(count, 1)) * arch.mass
    curves = (
        (newton_homotopy(arch, guess, some.p), guess),
        (growing_force(arch, some.p, force, np.ones(count)), some.z),
    )
    options = TraceOptions(**THROUGH, largest_step=0.2, steps=200)
    compiled = [trace(curve, z, (), options) for curve, z in curves]
    monkeypatch.setattr(Rod, "compiled_steps", lambda *_: None)
    for (curve, z), found in zip(curves, compiled, strict=True):
        general = trace(curve, z, (), options)
        assert count == 1 or (found.code == EventCode.ARRIVED).any()
        assert found.why == general.why
        for one, other in zip(_columns(found), _columns(general), strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_step_under_a_force_is_that_of_the_general_solve(starts: States):
    """The fused kernel against the bordered solve, at states that are none of equilibrium."""
    arch, generator = starts.structure, np.random.default_rng(6)
    p = starts.p[:9]
    z = arch.sample(p, generator)
    force, growth, row = generator.normal(size=(3, *z.shape))
    closing = row, generator.normal(size=9), generator.normal(size=9)
    fused = arch.advance_under((force, growth), z, p, *closing)
    general = Equations.advance_under(arch, (force, growth), z, p, *closing)
    np.testing.assert_array_equal(fused.index, general.index)
    for name in ("dz", "dt", "tangent_z", "tangent_t", "residual"):
        one, other = (getattr(each, name) for each in (fused, general))
        np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-9 * np.abs(other).max())


def test_results_of_compiled_loops_do_not_depend_on_other_lanes(starts: States):
    """Each lane alone ends where it ends among others, to the bit."""
    together = _traced(starts, 20, (10.0,))
    for lane in range(20):
        alone = _traced(starts[np.array([lane])], 1, (10.0,))
        assert alone.code[0] == together.code[lane]
        np.testing.assert_array_equal(alone.z[0], together.z[lane])
        np.testing.assert_array_equal(alone.t[0], together.t[lane])


@pytest.mark.parametrize("capacity", [1, 8, 13])
def test_results_of_compiled_loops_do_not_depend_on_the_batch(starts: States, capacity: int):
    some, arch = starts[np.arange(50)], starts.structure
    curve = ParameterLine(arch, some.p, np.tile([0.0, 0.0, 20.0, 0.0], (50, 1)))
    whole = trace(curve, some.z)
    parts = trace(curve, some.z, batching=Batching(capacity=capacity, threads=1))
    for one, other in zip(_columns(whole), _columns(parts), strict=True):
        np.testing.assert_array_equal(one, other)


def test_steps_that_wait_to_be_judged_end_like_those_that_are_judged_alone(
    monkeypatch: pytest.MonkeyPatch,
):
    """Symmetric arches pass a branch point each; in large blocks more are judged at once."""
    arch, p = em.Rod(load="uniform"), np.zeros((64, 4))
    p[:, 0], p[:, 1], p[:, 3] = np.linspace(0.85, 1.0, 64), 0.0, np.sin(1.0)
    starts, _ = arch.natural_states(p)
    curve = ParameterLine(arch, p, np.tile([0.0, 0.0, 20.0, 0.0], (64, 1)))
    within, options = (arch.max_curvature <= 20,), TraceOptions(**THROUGH)
    calls, judge = [0], RareSteps.judge

    def count(rare: RareSteps, move: Advance) -> None:
        calls[0] += 1
        judge(rare, move)

    monkeypatch.setattr(RareSteps, "judge", count)
    found, judgements = [], []
    for capacity in (1, 128):
        calls[0] = 0
        batching = Batching(capacity=capacity, threads=1)
        found.append(_columns(trace(curve, starts.z, within, options, batching=batching)))
        judgements.append(calls[0])
    assert judgements[0] > 4 * judgements[1] > 0
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


def test_constraints_on_other_descriptors_take_the_general_loop():
    arch = em.Rod(load="uniform")
    assert arch.compiled_steps([arch.max_curvature <= 10]) is not None
    assert arch.compiled_steps([arch.height(0.5) >= 0]) is None
    assert arch.compiled_steps([abs(arch.max_curvature) <= 10]) is None
    assert em.Spring().compiled_steps([]) is None


def test_states_of_another_resolution_are_refused_before_kernels_read_them(starts: States):
    some, finer = starts[np.arange(3)], em.Rod(load="uniform", elements=8)
    curve = ParameterLine(finer, some.p, np.tile([0.0, 0.0, 20.0, 0.0], (3, 1)))
    with pytest.raises(InputError, match="resolution"):
        trace(curve, some.z)
