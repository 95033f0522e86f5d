"""Shapes in space as files: read back as XML, and by VTK where it is installed."""

import base64
from xml.etree import ElementTree

import numpy as np
import pytest

import equimorph as em
from oracles.specimens import tripod


@pytest.fixture(scope="module")
def states():
    rod = em.SpatialRod(torsion=0.77, lateral=1.0, elements=4, degree=5)
    return em.lift(rod.natural_state(Theta=0.9), {"twist_B": 1.0}).states[[0, -1]]


def arrays(path):
    """All arrays of a VTP file by name, and its piece."""
    piece = ElementTree.parse(path).getroot().find("PolyData/Piece")
    kinds = {"Float64": "<f8", "Int64": "<i8"}
    found = {}
    for each in piece.iter("DataArray"):
        raw = base64.b64decode(each.text)
        (size,) = np.frombuffer(raw[:8], "<u8")
        values = np.frombuffer(raw[8 : 8 + int(size)], kinds[each.get("type")])
        found[each.get("Name")] = values.reshape(-1, int(each.get("NumberOfComponents", 1)))
    return found, piece


def test_centre_lines_have_frames_and_parameters(states, tmp_path):
    """One polyline a state; frames are those of the structure, and orthonormal."""
    found, piece = arrays(em.storage.write_shapes(tmp_path / "rod.vtp", states, lines=True))
    shapes = states.shape()
    assert int(piece.get("NumberOfLines")) == 2
    np.testing.assert_array_equal(found["Points"], shapes.reshape(-1, 3))
    np.testing.assert_array_equal(found["offsets"].ravel(), [101, 202])
    frame = np.stack([found[name] for name in ("tangent", "normal", "binormal")], axis=2)
    np.testing.assert_allclose(
        frame.swapaxes(1, 2) @ frame, np.tile(np.eye(3), (202, 1, 1)), atol=1e-12
    )
    np.testing.assert_array_equal(found["twist_B"][[0, -1], 0], states["twist_B"])
    assert (found["radius"] > 0.0).all()


def test_surfaces_have_unit_normals_and_lie_around_the_shape(states, tmp_path):
    found, piece = arrays(em.storage.write_shapes(tmp_path / "rod.vtp", states))
    assert 3 * int(piece.get("NumberOfPolys")) == len(found["Points"])
    np.testing.assert_allclose(np.linalg.norm(found["normals"], axis=1), 1.0)
    first = found["Points"][found["state"].ravel() == 0]
    gap = np.linalg.norm(first[::7, None] - states.shape()[0][None], axis=2).min(axis=1)
    assert gap.max() < 0.02


def test_trusses_are_written_as_bars(tmp_path):
    truss = tripod().natural_state().batch
    found, _ = arrays(em.storage.write_shapes(tmp_path / "truss.vtp", truss))
    assert found["Points"][:, 2].max() == pytest.approx(2.0, abs=0.03)
    found, _ = arrays(em.storage.write_shapes(tmp_path / "lines.vtp", truss, lines=True))
    assert "tangent" not in found


def test_vtk_reads_the_files(states, tmp_path):
    reader = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLPolyDataReader()
    reader.SetFileName(str(em.storage.write_shapes(tmp_path / "rod.vtp", states)))
    reader.Update()
    assert reader.GetOutput().GetNumberOfPolys() > 1000


@pytest.mark.parametrize("name", ["rod.ply", "rod"])
def test_other_endings_are_refused(states, tmp_path, name):
    with pytest.raises(em.InputError, match=r"must end in \.vtp"):
        em.storage.write_shapes(tmp_path / name, states)


def test_planar_structures_are_refused(tmp_path):
    flat = em.Rod().natural_state(Theta=0.9).batch
    with pytest.raises(em.InputError, match="structure in space"):
        em.storage.write_shapes(tmp_path / "rod.vtp", flat)
