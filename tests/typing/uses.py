"""Right and wrong uses of the public face, for type checkers: wrong lines are marked as such."""

from typing import assert_type

import equimorph as em

arch = em.Rod(load="uniform", span=0.9)
rest = arch.natural_state(Theta=0.9, Delta=0.0)
limit = em.limit_load(rest, "q", within=[arch.max_curvature <= 10])
eset = em.equilibrium_set(arch, em.Box(Theta=(0.2, 2.5)), fixed={"q": 2.5}, intervals=(10,))
route = em.plan(eset, rest, rest, margin=0.3)

assert_type(arch, em.Rod)
assert_type(rest, em.State)
assert_type(arch.max_curvature, em.Descriptor)
assert_type(arch.max_curvature <= 10, em.Constraint)
assert_type(eset, em.EquilibriumSet)
assert_type(eset.at(Theta=1.0), em.States)
assert_type(route, em.Route)
assert_type(route.margin, float)
assert_type(limit.value, float)

em.Rod(spam=3)  # wrong
em.nonexistent  # wrong
em.plotting.nonexistent  # wrong
em.Rod(span=[1.0])  # wrong
em.limit_load(rest, 3)  # wrong
em.limit_load("arch", "q")  # wrong
em.plan(eset, rest)  # wrong
em.equilibrium_set(arch)  # wrong
rest.nonexistent  # wrong
route.schedule.values  # wrong: a refused route has none
em.Truss({"A": (0.0, 0.0)}, [("A", "B")], {"A": "xy"}, strain="big")  # wrong
