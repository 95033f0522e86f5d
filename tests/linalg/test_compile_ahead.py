import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import equimorph as em
from equimorph.linalg import compile_ahead as ahead, compiled
from equimorph.linalg.compiled import kept_signatures
from equimorph.study import read_problem

EXAMPLES = Path(__file__).parents[2] / "examples"
SOURCE = """
from equimorph.linalg.compiled import njit

@njit(nogil=True)
def twice(x):
    return inner(x) + x

@njit(nogil=True)
def inner(x):
    return x
"""
OTHER = """
from numpy import ones
from {name} import twice
print(twice(ones(2)).sum(), twice.stats.cache_hits)
"""


def _names(calls: list[ahead.KernelCall]) -> set[str]:
    return {each.name.removeprefix("equimorph.structures.") for each in calls}


def test_every_line_of_the_list_names_a_kernel_and_types():
    """Calls that are not listed fail the test that makes them: see tests/conftest.py."""
    for call in ahead.known_calls():
        assert call.kernel.py_func.__module__ == call.name.rpartition(".")[0]
        assert len(call.types) == call.kernel.py_func.__code__.co_argcount


@pytest.mark.parametrize(
    ("study", "wanted", "unwanted"),
    [
        ("arch", "rod.clamped_kernels.advance_lanes", "rod.general_kernels.linearise_lanes"),
        ("beam", "rod.general_kernels.linearise_lanes", "rod.clamped_kernels.advance_lanes"),
        ("truss", "truss.kernels.linearise_lanes", "frame.kernels.linearise_lanes"),
        ("lee", "frame.kernels.linearise_lanes", "truss.kernels.linearise_lanes"),
        ("sideways", "spatial.step_kernels.advance_lanes", "rod.clamped_kernels.advance_lanes"),
    ],
)
def test_a_study_compiles_what_its_structure_needs(study: str, wanted: str, unwanted: str):
    _, _, problem = read_problem(EXAMPLES / f"{study}.toml")
    names = _names(ahead.calls_of(problem))
    assert wanted in names
    assert unwanted not in names
    assert _names(ahead.calls_of(em.Spring())) < names


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Name of a module of two kernels that were never compiled."""
    name = f"kernels_of_{tmp_path.name}"
    (tmp_path / f"{name}.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(tmp_path)
    return name


def test_calls_are_compiled_with_what_they_call(source: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(ahead, "cores", lambda: 1)
    call = ahead.KernelCall(0, f"{source}.twice", "(float64[::1],)", is_common=False)
    assert not call.is_kept
    ahead.compile_ahead([call])
    assert call.is_kept
    assert kept_signatures(sys.modules[source].inner.part()) == [call.types]
    assert not kept_signatures(sys.modules[source].inner)
    np.testing.assert_array_equal(call.kernel(np.ones(2)), [2, 2])
    assert not call.kernel.stats.cache_hits


def test_of_processes_that_need_a_kernel_one_compiles_it(source: str, tmp_path: Path):
    command = [sys.executable, "-c", OTHER.format(name=source)]
    others = [
        subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True) for _ in range(2)
    ]
    told = sorted(other.communicate()[0].split(maxsplit=1)[1] for other in others)
    assert told == ["Counter()\n", "Counter({(Array(float64, 1, 'C', False, aligned=True),): 1})\n"]


def test_what_another_process_compiles_is_done_without(
    source: str, monkeypatch: pytest.MonkeyPatch
):
    """Loops are awaited until their code is on disk, whoever puts it there."""
    call = ahead.KernelCall(7, f"{source}.twice", "(float64[::1],)", is_common=False)
    begun = []
    monkeypatch.setattr(ahead, "Popen", lambda command, **_: begun.append(command))
    monkeypatch.setattr(compiled, "AWAITED", awaited := set())
    monkeypatch.setattr(ahead, "AWAITED", awaited)
    ahead.compile_behind([call])
    assert begun[0][-2:] == [ahead.BEHIND, "7"]
    assert compiled.is_awaited(call.kernel)
    call.kernel.compile(call.types)
    assert not compiled.is_awaited(call.kernel)
    ahead.compile_behind([call])
    assert len(begun) == 1


def test_a_study_needs_no_loops(monkeypatch: pytest.MonkeyPatch):
    """While they are compiled, paths are followed by smaller kernels, to the same bits."""
    arch, loops = em.Rod(load="uniform"), [each for each in ahead.known_calls() if each.is_loop]
    start = arch.natural_state(Theta=1.0, Delta=0.5)
    ready = em.limit_load(start, "q")
    monkeypatch.setattr(compiled, "AWAITED", {each.name for each in loops})
    monkeypatch.setattr(compiled, "kept_signatures", lambda _: [])
    assert len(loops) == 3
    assert em.limit_load(start, "q").value == ready.value
