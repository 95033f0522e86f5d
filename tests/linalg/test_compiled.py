import ast
import importlib.util
from pathlib import Path

import numpy as np
import pytest
from numba import float64, int64

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
    assert not compiled.kept_signatures(first)
    assert first(2.0) == 4.0
    assert compiled.kept_signatures(first) == [(float64,)]
    again = fresh().double
    assert again(3.0) == 6.0
    assert _hits(again) == 1


def test_a_change_of_sources_makes_kernels_new(fresh, monkeypatch: pytest.MonkeyPatch):
    assert fresh().double(2.0) == 4.0
    monkeypatch.setattr(compiled, "digest", lambda _: "of changed sources")
    changed = fresh().double
    assert not compiled.kept_signatures(changed)
    assert changed(2.0) == 4.0
    assert _hits(changed) == 0


def test_what_kernels_call_has_no_machine_code(fresh):
    """It is kept for callers, and becomes code when Python calls it, too."""
    module = fresh()
    assert module.triple_of_literal() == 6
    assert not module.double.signatures
    assert not compiled.kept_signatures(module.double)
    again = fresh()
    assert again.double.part().compile((int64,))
    assert _hits(again.double.part()) == 1
    assert again.double(2) == 4


def test_literal_numbers_make_no_copies(fresh):
    module = fresh()
    assert module.triple_of_literal() == 6
    assert len(module.double.part().signatures) == 1


def test_code_for_several_types_is_kept_side_by_side(fresh):
    one, other = fresh().double, fresh().double
    assert one(2) == 4
    np.testing.assert_array_equal(other(np.ones(2)), [2, 2])
    third = fresh().double
    assert third(5) == 10
    np.testing.assert_array_equal(third(np.ones(3)), [2, 2, 2])
    assert _hits(third) == 2


def test_what_a_kernel_calls_in_other_files_belongs_to_its_sources():
    package = Path(equimorph.__file__).parent
    kernels = package / "structures" / "rod" / "clamped_kernels.py"
    watched = {path.name for path in compiled.sources(kernels)}
    assert {"clamped_kernels.py", "condensed_kernels.py", "simd.py", "compiled.py"} <= watched
    assert "chain_kernels.py" not in watched


def test_kernels_import_in_the_way_that_is_watched():
    """Every import of ours in a file of kernels is one that `sources` follows to a file."""
    package = Path(equimorph.__file__).resolve().parent
    for path in package.rglob("*.py"):
        if "njit" not in (text := path.read_text()) and "numba" not in text:
            continue
        tree = ast.parse(text)
        nodes = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        froms = {node.module for node in nodes if node.module}
        is_shared = path in compiled.SHARED
        if "equimorph.linalg.compiled" in froms and "njit" in text:
            ours = {name for name in froms if name.startswith("equimorph")}
            assert all(name.endswith(("kernels", "simd", "compiled")) for name in ours), path
            watched = {str(each.relative_to(package.parent)) for each in compiled.sources(path)}
            assert {name.replace(".", "/") + ".py" for name in ours} <= watched
            assert not any(
                alias.name.startswith("equimorph")
                for node in ast.walk(tree)
                if isinstance(node, ast.Import)
                for alias in node.names
            )
        assert "numba" not in froms or is_shared


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
