"""Unknown parameters, offsets and gains of structures from measured states."""

from equimorph.tasks.calibration.calibrate import Calibration, calibrate
from equimorph.tasks.calibration.measurements import MeasuredShape, MeasuredValues
from equimorph.tasks.calibration.unknowns import Family

__all__ = ["Calibration", "Family", "MeasuredShape", "MeasuredValues", "calibrate"]
