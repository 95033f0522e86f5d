"""Geometry that other programs drew, for trusses and frames."""

from equimorph.io.lines import Lines as Lines, read_lines as read_lines
