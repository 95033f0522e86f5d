"""Unknown parameters, offsets and gains of structures from measured states."""

from equimorph.tasks.calibration.calibrate import Calibration, calibrate
from equimorph.tasks.calibration.measured import MeasuredShape, MeasuredValues

__all__ = ["Calibration", "MeasuredShape", "MeasuredValues", "calibrate"]
