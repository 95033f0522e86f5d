"""Schedules in time: replay in a simulator of rigid bodies, and what happens at folds."""

from equimorph.dynamics.replay import (
    Replay as Replay,
    ReplaySettings as ReplaySettings,
    replay as replay,
)
from equimorph.dynamics.shock import (
    LeastShock as LeastShock,
    Shock as Shock,
    least_shock as least_shock,
)
from equimorph.dynamics.simulated_plant import SimulatedPlant as SimulatedPlant
from equimorph.dynamics.snap_in_time import (
    HeldLanding as HeldLanding,
    SnapInTime as SnapInTime,
    snap_in_time as snap_in_time,
)
