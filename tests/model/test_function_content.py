"""A function is told from another of its name by all that it computes with."""

import functools
from pathlib import Path

import numpy as np
import pytest

import equimorph as em
from equimorph.model import Descriptor, content_of_descriptor, content_of_function


def _made(text: str, **known: object) -> str:
    """Content of the function ``f`` that a source defines."""
    space: dict[str, object] = {"np": np, **known, "__name__": "__main__"}
    exec(text, space)  # a function as it stands in a user's file
    return content_of_function(space["f"], "f")


PLAIN = "def f(z, p):\n    return 2.0 * z[:, 0]"
OTHERS = {
    "another constant": "def f(z, p):\n    return 3.0 * z[:, 0]",
    "another column": "def f(z, p):\n    return 2.0 * z[:, 1]",
    "another argument": "def f(z, p):\n    return 2.0 * p[:, 0]",
    "a default": "def f(z, p, k=1):\n    return 2.0 * z[:, 0]",
    "a function of numpy": "def f(z, p):\n    return np.sin(z[:, 0])",
    "another function of numpy": "def f(z, p):\n    return np.cos(z[:, 0])",
    "a function inside": "def f(z, p):\n    return (lambda x: 2.0 * x)(z[:, 0])",
    "another function inside": "def f(z, p):\n    return (lambda x: 3.0 * x)(z[:, 0])",
    "a global": "k = 2.0\ndef f(z, p):\n    return k * z[:, 0]",
    "another global": "k = 3.0\ndef f(z, p):\n    return k * z[:, 0]",
    "a function beside": "def g(x):\n    return 2 * x\ndef f(z, p):\n    return g(z[:, 0])",
    "another beside": "def g(x):\n    return 3 * x\ndef f(z, p):\n    return g(z[:, 0])",
    "a table": "t = np.array([1.0, 2.0])\ndef f(z, p):\n    return t[0] * z[:, 0]",
    "another table": "t = np.array([1.5, 2.0])\ndef f(z, p):\n    return t[0] * z[:, 0]",
    "a class": "class C:\n    k = 1\n    def __call__(s, z, p):\n        return z[:, 0]\nf = C()",
    "another method": "class C:\n    k = 1\n    def __call__(s, z, p):\n        return p\nf = C()",
    "a third": "class C:\n    k = 1\n    def __call__(s, z, p):\n        return 0\nf = C()",
    "an attribute": "class C:\n    k = 2\n    def __call__(s, z, p):\n        return 0\nf = C()",
}


def test_functions_that_differ_anywhere_have_other_contents():
    found = {"plain": _made(PLAIN)} | {name: _made(text) for name, text in OTHERS.items()}
    assert len(set(found.values())) == len(found)


@pytest.mark.parametrize("text", [PLAIN, *OTHERS.values()], ids=["plain", *OTHERS])
def test_the_same_source_has_the_same_content_wherever_it_stands(text: str):
    assert _made(text) == _made("\n\n" + text)


def test_what_is_closed_over_counts():
    def times(k):
        return lambda z, p: k * z[:, 0]

    one, other = (content_of_function(times(k), "k") for k in (2.0, 3.0))
    assert one != other
    assert one == content_of_function(times(2.0), "k")
    arrays = [np.arange(5.0), np.arange(5.0), np.arange(5.0)[::-1]]
    same, again, reverse = (content_of_function(times(each), "k") for each in arrays)
    assert same == again
    assert same != reverse


def test_partials_methods_and_recursion_are_told():
    def power(z, p, k):
        return z[:, 0] if k == 0 else z[:, 0] * power(z, p, k - 1)

    one, two = (content_of_function(functools.partial(power, k=k), "k") for k in (1, 2))
    assert one != two
    assert content_of_function([1].index, "i") != content_of_function([2].index, "i")


def test_a_module_of_the_user_counts_by_what_is_used_of_it(tmp_path: Path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    contents = []
    for number in range(3):
        name = f"helpers_{number}"
        factor = 2.0 if number < 2 else 3.0
        (tmp_path / f"{name}.py").write_text(f"def scaled(x):\n    return {factor} * x\n")
        contents.append(_made("def f(z, p):\n    return h.scaled(z)", h=__import__(name)))
    assert contents[0] != contents[2]


@pytest.mark.parametrize("structure", [em.Spring(), em.Rod()], ids=["spring", "rod"])
def test_combinations_of_descriptors_are_told(structure):
    energy = structure.descriptor("energy")
    margin = em.margin_of(structure)
    one = em.function_of("mine", lambda a, b: a - b, energy, margin)
    other = em.function_of("mine", lambda a, b: a + b, energy, margin)
    same = em.function_of("mine", lambda a, b: a - b, energy, margin)
    assert content_of_descriptor(one) != content_of_descriptor(other)
    assert content_of_descriptor(one) == content_of_descriptor(same)


def test_what_cannot_be_told_is_refused_by_name(tmp_path: Path):
    with (tmp_path / "table").open("w") as file, pytest.raises(em.InputError) as found:
        content_of_descriptor(Descriptor("mine", "1", lambda z, p: z[:, 0] * file.fileno()))
    assert "`mine` must be computed from numbers" in str(found.value)
    assert "TextIOWrapper" in str(found.value)
    assert "\n" not in str(found.value)
