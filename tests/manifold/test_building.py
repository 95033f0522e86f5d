"""Progress, cancelling and repeating of sets over one, two and three parameters."""

import numpy as np
import pytest

from equimorph.errors import CancelledError
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box
from equimorph.structures import Spring
from typecheck import unchecked

PROBLEMS = {
    1: (Box(F=(-0.4, 0.4)), {"x_l": 0.7}, (8,)),
    2: (Box(x_l=(0.5, 1.2), F=(-0.3, 0.3)), {}, (6, 7)),
    3: (Box(x_l=(0.5, 1.2), F=(-0.3, 0.3), k=(0.5, 2.0)), {}, (3, 4, 2)),
}


class Sink:
    """Keeps the reports, and cancels at one of them."""

    def __init__(self, last: int | None = None) -> None:
        self.reports: list[tuple[str, int, int | None]] = []
        self.last = last

    def report(self, stage: str, done: int, total: int | None) -> None:
        self.reports.append((stage, done, total))
        if len(self.reports) == self.last:
            raise CancelledError("enough")


def built(d: int, sink: Sink | None = None) -> EquilibriumSet:
    box, fixed, intervals = PROBLEMS[d]
    with unchecked():
        return equilibrium_set(Spring(), box, fixed=fixed, intervals=intervals, progress=sink)


@pytest.mark.parametrize("d", [1, 2, 3])
def test_building_reports_its_stages_and_ends_when_cancelled(d):
    sink = Sink()
    built(d, sink)
    stages = [stage for stage, _, _ in sink.reports]
    assert {"seeds", "lifting edges", "closing loops", "independent checks"} <= set(stages)
    for last in (1, len(stages) // 2, len(stages)):
        cancelled = Sink(last)
        with pytest.raises(CancelledError):
            built(d, cancelled)
        assert len(cancelled.reports) == last


@pytest.mark.parametrize("d", [1, 2, 3])
def test_building_twice_gives_the_same_set(d):
    """Bit by bit, with random searches in it."""
    one, other = built(d), built(d)
    np.testing.assert_array_equal(one.points.z, other.points.z)
    np.testing.assert_array_equal(one.cells, other.cells)
    assert one.audit == other.audit
