"""What lanes leave behind as they march."""

from equimorph.equilibria.records.files import EventFile, PointFile

__all__ = ["EventFile", "PointFile"]
