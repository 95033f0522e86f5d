"""Geometry that other programs drew, for trusses and frames."""

from equimorph.io.lines import Lines, read_lines

__all__ = ["Lines", "read_lines"]
