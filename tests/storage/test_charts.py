"""Charts and atlases in files: they come back bit for bit and answer alike."""

from pathlib import Path

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.manifold import part
from equimorph.storage import load_chart, save_chart
from typecheck import unchecked

AT = np.array([[0.7, 0.05], [0.8, -0.03], [1.2, 0.1], [0.6, 0.0], [0.2, 0.0]])


def made(kind, eset):
    spring = eset.structure
    makers = {
        "projection": lambda: em.Projection(part(eset, eset.cell_index == 0)),
        "descriptors": lambda: em.DescriptorChart(eset, [spring.angle, "x_l"]),
        "lowest": lambda: em.reduce(eset, prefer=em.charts.lowest(spring.descriptor("energy"))),
        "quasi_static": lambda: em.reduce(eset, prefer=em.quasi_static("F")),
        "first_stable": lambda: em.reduce(eset, prefer=em.first_stable_on_path("F", bound=2.0)),
        "nearest": lambda: em.reduce(eset, prefer=em.charts.nearest(0)),
        "atlas": lambda: em.dissect(eset),
    }
    with unchecked():
        return makers[kind]()


@pytest.mark.parametrize(
    "kind", ["projection", "descriptors", "lowest", "quasi_static", "first_stable", "nearest"]
)
def test_charts_come_back_and_answer_alike(kind, spring_set, tmp_path):
    """Identity: states bit for bit, statuses alike."""
    chart = made(kind, spring_set)
    with unchecked():
        back = load_chart(save_chart(tmp_path / "chart.h5", chart))
    assert repr(back) == repr(chart)
    with unchecked():
        one, other = chart.state(AT), back.state(AT)
    assert one.status.tolist() == other.status.tolist()
    np.testing.assert_array_equal(one.states.z, other.states.z)
    if isinstance(chart, em.Reduction):
        assert chart.rule.identity == back.rule.identity
        assert len(chart.barriers) == len(back.barriers)
        for ours, theirs in zip(chart.barriers, back.barriers, strict=True):
            assert ours.kind == theirs.kind
            for name in ("points", "jump", "facets"):
                np.testing.assert_array_equal(getattr(ours, name), getattr(theirs, name))
            np.testing.assert_array_equal(ours.far.z, theirs.far.z)


def test_atlases_come_back(spring_set, tmp_path):
    """Identity: charts, transitions and paths."""
    atlas = made("atlas", spring_set)
    back = load_chart(save_chart(tmp_path / "atlas.h5", atlas))
    assert repr(back) == repr(atlas)
    np.testing.assert_array_equal(back.chart, atlas.chart)
    for ours, theirs in zip(atlas.transitions, back.transitions, strict=True):
        assert (ours.charts, ours.kind) == (theirs.charts, theirs.kind)
        np.testing.assert_array_equal(ours.coords[1], theirs.coords[1])
    here = spring_set.at(x_l=0.8, F=0.0).stable
    assert [c for c, *_ in back.path(*here).legs] == [c for c, *_ in atlas.path(*here).legs]


def test_what_cannot_be_written_down_is_refused(spring_set, tmp_path):
    angle = spring_set.structure.angle
    with unchecked():
        chart = em.reduce(spring_set, prefer=lambda states: -angle(states))
    with pytest.raises(InputError, match=r"rule that can be written down .* got one by score"):
        save_chart(tmp_path / "chart.h5", chart)
    leaf = made("atlas", spring_set).charts[0]
    with pytest.raises(InputError, match="not be part of an atlas"):
        save_chart(tmp_path / "chart.h5", leaf)
    assert not (tmp_path / "chart.h5").exists()


def test_damage_is_found(spring_set, tmp_path):
    path: Path = save_chart(tmp_path / "chart.h5", made("projection", spring_set))
    whole = path.read_bytes()
    path.write_bytes(whole[:2000] + bytes([whole[2000] ^ 1]) + whole[2001:])
    with pytest.raises(InputError):
        load_chart(path)
    with pytest.raises(InputError):
        load_chart(em.storage.save_set(tmp_path / "set.h5", spring_set))
