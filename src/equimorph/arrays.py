"""Array types, and array shapes that appear throughout the package; the batch axis is `lanes`.

Aliases for shapes that only one module uses stay in that module.
"""

import numpy as np

from equimorph.array_types import (
    Bool as Bool,
    Complex as Complex,
    Float as Float,
    Int as Int,
    Num as Num,
    Shaped as Shaped,
    UInt8 as UInt8,
    UInt16 as UInt16,
)

# one row for each lane of a batch
Lanes = Float[np.ndarray, "lanes size"]
"""Unknowns and multipliers z = (u, λ) of each lane."""
Velocity = Float[np.ndarray, "lanes unknowns"]
"""Rates of the unknowns u of each lane."""
Parameters = Float[np.ndarray, "lanes parameters"]
"""All parameters p of the structure, in its order, for each lane."""
Values = Float[np.ndarray, " lanes"]
"""One scalar a lane."""
Determinants = Float[np.ndarray, "lanes 2"]
"""A determinant m·2^e a lane, as m and e; see `linalg.determinants`."""
Flags = Bool[np.ndarray, " lanes"]
"""One truth value a lane."""
Nodal = Float[np.ndarray, "lanes nodes"]
"""A field at the nodes of the discretisation."""
Entries = Float[np.ndarray, "lanes entries"]
"""Entries of the KKT matrix in the layout of its structure."""
Scalars = Float[np.ndarray, "lanes scalars"]
"""Several scalars a lane."""
Sides = Float[np.ndarray, "lanes sides bordered"]
"""Right-hand sides of bordered systems, several a lane."""
Directions = Float[np.ndarray, "lanes k parameters"]
"""Changes of the parameters along k directions."""
Settings = Float[np.ndarray, "lanes 2"]
"""Two parameters a lane."""
Frames = Float[np.ndarray, "lanes d full"]
"""Orthonormal bases of tangent spaces: changes of z and of the scaled free parameters."""
Rows = Float[np.ndarray, "lanes d coordinates"]
"""Rows of conditions in the metric coordinates of the set."""

# points, edges and cells of complexes
Points = Float[np.ndarray, "points d"]
"""Places in the space of the free parameters."""
Edges = Int[np.ndarray, "edges 2"]
"""Numbers of the two ends of each edge."""
Cells = Int[np.ndarray, "C corners"]
"""Numbers of the corners of each cell."""
Some = Int[np.ndarray, " some"]
"""Numbers of selected rows."""
Pair = Float[np.ndarray, " 2"]
"""Two numbers."""

# one row for each of n things: vertices, edges, cells, points
Numbers = Int[np.ndarray, " lanes"]
"""A whole number a lane."""
Items = Int[np.ndarray, " n"]
"""A whole number for each of n things."""
ItemFlags = Bool[np.ndarray, " n"]
"""A truth value for each of n things."""
ItemValues = Float[np.ndarray, " n"]
"""A scalar for each of n things."""
VertexFlags = Bool[np.ndarray, " V"]
"""A truth value for each vertex of a complex."""
VertexNumbers = Int[np.ndarray, " V"]
"""A whole number for each vertex of a complex."""
CellFlags = Bool[np.ndarray, " C"]
"""A truth value for each cell of a complex."""
CellNumbers = Int[np.ndarray, " C"]
"""A whole number for each cell of a complex."""
EdgeFlags = Bool[np.ndarray, " E"]
"""A truth value for each edge of a complex."""
Place = Float[np.ndarray, " d"]
"""A point in the space of the free parameters."""
Places = Float[np.ndarray, "n d"]
"""Points in the space of the free parameters, one for each of n things."""
Pairs = Int[np.ndarray, "n 2"]
"""Two numbers for each of n things, such as the ends of edges."""
Facets = Int[np.ndarray, "n d"]
"""Numbers of the vertices of n facets."""
Triples = Int[np.ndarray, "n 3"]
"""Three numbers for each of n things, such as the corners of triangles."""
