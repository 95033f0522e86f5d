"""Lines and polylines of DXF files, by ezdxf."""

from pathlib import Path
from typing import Any

import numpy as np

from equimorph.errors import InputError
from equimorph.io.drawing import Drawing, Polyline, count_words
from equimorph.optional_packages import load_package

INSUNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km"}
"""Units by the number in the header of a file; 0 states none."""
POLYLINES = ("LWPOLYLINE", "POLYLINE")


def read_dxf(path: Path) -> Drawing:
    """Read the lines of the model space.

    Raises
    ------
    InputError
        If the file cannot be read, a polyline has arcs, or ezdxf is not installed.
    """
    ezdxf = load_package("ezdxf", "geometry", "read_lines")
    try:
        document = ezdxf.readfile(path)
    except (OSError, ezdxf.DXFError, UnicodeError) as error:
        raise InputError(f"`{path.name}` must be a DXF file; got: {error}.") from error
    found: list[Polyline] = []
    others = []
    for entity in document.modelspace():
        kind = entity.dxftype()
        if kind == "LINE":
            found.append(np.array([entity.dxf.start.xyz, entity.dxf.end.xyz]))
        elif kind in POLYLINES:
            found += _pieces(entity, path)
        else:
            others.append(kind)
    return Drawing(found, INSUNITS.get(document.units, ""), count_words(others))


def _pieces(entity: Any, path: Path) -> list[Polyline]:
    pieces = []
    for piece in entity.virtual_entities():
        if piece.dxftype() != "LINE":
            raise InputError(
                f"`{path.name}` must have straight lines; got {piece.dxftype()} in a "
                f"{entity.dxftype()} on layer {entity.dxf.layer}. Divide it into lines."
            )
        pieces.append(np.array([piece.dxf.start.xyz, piece.dxf.end.xyz]))
    return pieces
