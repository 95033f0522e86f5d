"""Shape-control tasks on an equilibrium set."""

from equimorph.tasks.plan import plan
from equimorph.tasks.route import Route

__all__ = ["Route", "plan"]
