"""The command line."""

from equimorph.cli.app import main

__all__ = ["main"]
