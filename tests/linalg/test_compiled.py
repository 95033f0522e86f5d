import ast
import importlib.util
from pathlib import Path

import numpy as np
import pytest

import equimorph
from equimorph.linalg import compiled

SOURCE = """
from equimorph.linalg.compiled import njit

@njit(nogil=True)
def double(x):
    return x + x

@njit(nogil=True)
def triple_of_literal():
    return double(1) + double(2)
"""


@pytest.fixture
def fresh(tmp_path: Path):
    """Import the kernels of SOURCE as a process of its own would."""
    path = tmp_path / "some_kernels.py"
    path.write_text(SOURCE)

    def load():
        spec = importlib.util.spec_from_file_location("some_kernels", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load


def _hits(kernel) -> int:
    return sum(kernel.stats.cache_hits.values())


def test_compiled_code_is_kept(fresh):
    first = fresh().double
    assert not compiled.is_kept(first)
    assert first(2.0) == 4.0
    assert compiled.is_kept(first)
    again = fresh().double
    assert again(3.0) == 6.0
    assert _hits(again) == 1


def test_a_change_of_any_kernel_makes_all_new(fresh, monkeypatch: pytest.MonkeyPatch):
    assert fresh().double(2.0) == 4.0
    monkeypatch.setattr(compiled, "DIGEST", "of changed sources")
    changed = fresh().double
    assert not compiled.is_kept(changed)
    assert changed(2.0) == 4.0
    assert _hits(changed) == 0


def test_literal_numbers_make_no_copies(fresh):
    module = fresh()
    assert module.triple_of_literal() == 6
    assert len(module.double.signatures) == 1


def test_code_for_several_types_is_kept_side_by_side(fresh):
    one, other = fresh().double, fresh().double
    assert one(2) == 4
    np.testing.assert_array_equal(other(np.ones(2)), [2, 2])
    third = fresh().double
    assert third(5) == 10
    np.testing.assert_array_equal(third(np.ones(3)), [2, 2, 2])
    assert _hits(third) == 2


def test_kernels_are_made_of_sources_that_are_watched():
    package = Path(equimorph.__file__).parent
    watched = {source.resolve() for source in compiled.SOURCES}
    for path in package.rglob("*.py"):
        tree = ast.parse(path.read_text())
        froms = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        if "equimorph.linalg.compiled" in froms and "njit" in path.read_text():
            assert path.resolve() in watched
            ours = {name for name in froms if name and name.startswith("equimorph")}
            assert all(name.endswith(("kernels", "simd", "compiled")) for name in ours), path
        assert "numba" not in froms or path.resolve() in watched


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", ["cut", "changed", "appended"])
def test_damaged_code_is_compiled_anew(fresh, tmp_path: Path, suffix: str, damage: str):
    """Whatever happened to the files, kernels give what they give, and are kept again."""
    assert fresh().double(2.0) == 4.0
    for path in tmp_path.rglob(f"*double*.{suffix}"):
        content = path.read_bytes()
        middle = len(content) // 2
        changed = content[:middle] + bytes([content[middle] ^ 255]) + content[middle + 1 :]
        pieces = {"cut": content[:middle], "changed": changed, "appended": content + b"0123"}
        path.write_bytes(pieces[damage])
    assert fresh().double(2.0) == 4.0
    again = fresh().double
    assert again(3.0) == 6.0
    assert _hits(again) == 1
