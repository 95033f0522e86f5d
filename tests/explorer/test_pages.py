"""What Python puts into pages: arrays, pictures, texts."""

import base64
import json
import re
import tomllib
import zlib
from dataclasses import replace

import numpy as np
import pytest

import equimorph as em
from equimorph.explorer.contents import curved_edges, study_text, toml
from equimorph.explorer.pictures import FIDELITY, gallery, json_in_html, pack, quantise
from equimorph.manifold import edge_middles
from equimorph.study.problem import parse_study
from oracles.specimens import SPECIMENS

DTYPES = {"u8": np.uint8, "u16": np.uint16, "i32": np.int32, "f32": np.float32}


def _unpack(directory, text):
    """The page's own unpacking, written a second time."""
    data, out = zlib.decompress(base64.b64decode(text)), {}
    for each in directory:
        dtype = np.dtype(DTYPES[each["kind"]])
        count = each["rows"] * each["columns"]
        planes = np.frombuffer(data[: count * dtype.itemsize], np.uint8)
        data = data[count * dtype.itemsize :]
        whole = planes.reshape(dtype.itemsize, -1).T.copy().view(dtype).ravel()
        columns = whole.reshape(each["columns"], each["rows"])
        if dtype.kind != "f":
            columns = np.cumsum(columns, axis=1, dtype=dtype)
        out[each["name"]] = columns.T
    assert not data
    return out


def test_packed_arrays_are_the_same_when_unpacked():
    rng = np.random.default_rng(0)
    arrays = {
        "a": rng.integers(0, 65536, (50, 3)).astype(np.uint16),
        "b": rng.integers(-5, 10**6, (40, 2)).astype(np.int32),
        "c": rng.normal(size=17).astype(np.float32),
        "d": rng.integers(0, 256, 9).astype(np.uint8),
        "e": np.zeros((0, 2), np.int32),
    }
    found = _unpack(*pack(arrays))
    for name, array in arrays.items():
        assert np.array_equal(found[name].reshape(array.shape), array)


def test_quantised_values_are_within_half_a_step():
    values = np.random.default_rng(1).normal(size=1000)
    whole, low, step = quantise(values)
    assert np.abs(low + step * whole - values).max() <= 0.5 * step * (1 + 1e-9)
    assert quantise(np.full(3, 2.0))[1:] == (2.0, 0.0)


def test_middles_of_edges_are_exact_states(spring_set):
    """F = k (1 − x_l/cos δ) sin δ; those that a page holds bend away from their edges."""
    whole, kept = edge_middles(spring_set), curved_edges(spring_set)
    assert len(np.unique(whole.ends, axis=0)) == len(whole.ends)
    assert 0 < len(kept.ends) < len(whole.ends)
    for each in (whole, kept):
        angle = spring_set.structure.angle(each.states)
        length, force = each.states["x_l"], each.states["F"]
        assert (1.0 - length / np.cos(angle)) * np.sin(angle) == pytest.approx(force, abs=1e-9)


def test_text_in_scripts_cannot_end_them():
    text = json_in_html({"title": "</script><!--\u2028"})
    assert "<" not in text
    assert json.loads(text)["title"] == "</script><!--\u2028"


@pytest.mark.parametrize("specimen", SPECIMENS, ids=lambda each: each.name)
def test_pictures_of_every_structure_are_mean_and_modes(specimen):
    """The drawn points at states are those of the structure within the stated fidelity.

    Rounding adds less than the stated fidelity once more.
    """
    states = em.States(specimen.structure, *specimen.states(lanes=40)[:2])
    found = gallery(states)
    pictures = found.mean + (found.low + found.step * found.coefficients) @ found.modes
    shape = states.shape()
    drawn = pictures[:, : shape[0].size].reshape(shape.shape)
    assert found.error <= FIDELITY
    assert np.abs(drawn - shape).max() <= 2.5 * FIDELITY * found.size
    json.dumps(found.layout)


def test_pictures_do_not_depend_on_the_unit_of_length():
    """A rod of 300 mm, and the same of 1: its points, and steps of coefficients, are 300 times."""
    pages = []
    for more in (
        {},
        {"EI": "2 N mm^2", "length": "300 mm", "units": {"force": "N", "length": "mm"}},
    ):
        rod = em.Rod("uniform", **more)
        states = em.lift(rod.natural_state(Theta=1.0), {"Theta": 0.8}).states
        pages.append(gallery(states))
    plain, sized = pages
    assert sized.size == pytest.approx(300.0 * plain.size)
    np.testing.assert_allclose(sized.step, 300.0 * plain.step, rtol=1e-6)
    assert sized.coefficients.shape == plain.coefficients.shape


def test_values_are_written_as_toml():
    value = {"a b": [1, 2.5, True, 'x\n"y"'], "c": {"d": np.float64(1e-7)}, "e": None}
    assert tomllib.loads(f"v = {toml(value)}")["v"] == {
        "a b": [1, 2.5, True, 'x\n"y"'], "c": {"d": 1e-7},
    }  # fmt: skip
    with pytest.raises(em.InputError, match="must be plain data"):
        toml(object())


def test_the_study_of_a_set_is_the_study_of_that_set(spring_set):
    """The structure and the part of its set come back from the text."""
    study = parse_study(study_text(spring_set, 'a "title"'), "drawn.toml")
    assert study.title == 'a "title"'
    assert study.equilibrium_set.box == {"x_l": [0.4, 1.4], "F": [-0.3, 0.3]}
    assert study.structure.kind == "spring"


def test_the_page_is_one_escaped_file(spring_page):
    """Titles cannot leave their places, and nothing names an address of the network."""
    text = spring_page.read_text(encoding="utf-8")
    assert "<title>Spring &lt;/script&gt;&lt;b&gt;&amp;amp;</title>" in text
    assert text.count("</script>") == 3
    assert "connect-src" not in text
    assert "default-src 'none'" in text
    assert not re.search(r'(src|href)="(?!data:)', text)
    assert "Copyright © 2010-2026 three.js authors" in text


def test_what_cannot_be_shown_is_refused_in_one_line(spring_set, tmp_path):
    with pytest.raises(em.InputError, match=r"`path` must end in \.html; got"):
        em.explore(spring_set, path=tmp_path / "page.htm")
    with pytest.raises(em.InputError, match="must be a"):
        em.explore(spring_set, path=tmp_path / "page.html", route="around")
    empty = em.SnapGraph(spring_set, (), ())
    with pytest.raises(em.InputError):
        em.explore(spring_set, path=tmp_path / "no" / "page.html", snaps=empty)
    other = em.SnapGraph(replace(spring_set), (), ())
    with pytest.raises(em.InputError, match="must be of `eset`"):
        em.explore(spring_set, path=tmp_path / "p.html", snaps=other)
    rod = em.Rod(load="uniform")
    with pytest.raises(em.InputError, match="must describe the structure Spring"):
        em.explore(
            spring_set,
            path=tmp_path / "p.html",
            descriptors=[rod.descriptor("height(0.5)")],
            snaps=empty,
        )
