"""The public face: what `import equimorph` offers, and what type checkers see of it."""

import ast
from importlib import import_module
from inspect import signature
from operator import attrgetter
from pathlib import Path

import pytest

import equimorph as em
from equimorph.study.kinds import KINDS
from equimorph.study.structures import PARTS, SECTIONS

STUB = ast.parse(Path(em.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
HOMES = {
    alias.name: node.module
    for node in STUB.body
    if isinstance(node, ast.ImportFrom) and node.module
    for alias in node.names
}


def test_every_name_of_the_stub_is_the_object_that_its_layer_exports():
    """Type checkers read the stub, users get the object: both must be the same."""
    for name, home in HOMES.items():
        layer = import_module(f"equimorph.{home}")
        assert getattr(em, name) is getattr(layer, name), (name, home)


def test_every_task_and_every_structure_stands_in_the_stub():
    """Whoever adds one and forgets the stub hears it from this test."""
    assert {task.__name__ for kind in KINDS for task in kind.tasks} <= set(HOMES)
    assert {each.__name__ for each in em.structures.KINDS.values()} <= set(HOMES)


def test_every_structure_has_a_section_of_its_kind_in_study_files():
    """All arguments have keys but kinks: tables say theirs, and files hold no functions."""
    elsewhere = {"kinks"}
    for kind, made in em.structures.KINDS.items():
        keys = set(SECTIONS[kind].model_fields)
        assert keys - {"kind"} == set(signature(made).parameters) - elsewhere, kind
    for section, made in PARTS.items():
        keys = set(section.model_fields) | ({"period"} if made is em.Parameter else set())
        assert keys == set(signature(made).parameters), made


def test_all_public_names_complete():
    """`dir` is what completion offers."""
    assert set(HOMES) <= set(dir(em))
    assert set(HOMES) <= set(em.__all__)


def test_names_of_the_last_version_stay_for_a_release():
    """Each warns with the new name, which the warning's reader can type as it stands."""
    for old, new in em.RENAMED.items():
        with pytest.warns(DeprecationWarning, match=rf"`equimorph\.{new}` now"):
            found = getattr(em, old)
        assert found is attrgetter(new)(em)
        assert old not in dir(em)
