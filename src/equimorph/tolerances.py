"""Tolerances that several modules share, in groups; each says the scale that it is measured in.

A tolerance that only one algorithm uses is defined with that algorithm.
"""

# Identity: two things nearer than this are the same.
SAME_STATE = 1e-6
"""Distance of two states in the structure's metric."""
SAME_SOLUTION = 1e-5
"""Distance, in the metric and scaled parameters, of two states that separate iterations found, such
as descents, gradient flows and queries, which end less sharply than Newton's method."""
SAME_VERTEX = 1e-7
"""Distance, in the metric, of two exact vertices of a complex."""
SAME_PLACE = 1e-7
"""Distance of two settings, in units of the parameters' scales."""
SAME_NUMBER = 1e-9
"""Difference of two numbers, relative to the largest of those that are compared."""

SAME_TO_ROUNDING = 1e-12
"""Difference of two numbers, relative to one and to their size, that round-off explains."""
IN_BOX = 1e-12
"""Distance beyond a side of a box up to which points lie in it: relative to the width of the box,
or in units of the parameters."""

SINGULAR = 1e-10
"""Eigenvalue of a stiffness matrix, relative to the largest one, that counts as zero."""

# Convergence: an iteration has ended.
CONVERGED = 1e-10
"""Last Newton correction in the structure's metric: at round-off."""

FEASIBLE = 1e-7
"""Relative excess over a bound with which a point counts as obeying it."""

ON_SIDE = 1e-9
"""Distance from a side of a box, relative to its width, of points that lie on it."""

# Effort: how far searches over a set go at a time, and when they end.
LONGEST_STEP = 0.3
"""Longest step in the metric."""
LAST_STEP = 1e-9
"""Length in the metric of a step that is the last."""

# Difference: steps of finite differences.
METRIC_DIFFERENCE = 1e-5
"""Step of central differences along curves and tangents of the set, in the metric: their error and
that of round-off are about 1e-11."""

# Motion: what a replay in time tells apart.
DEPARTURE = 0.05
"""Distance from the static branch, relative to the structure's size, at which a motion has left."""
