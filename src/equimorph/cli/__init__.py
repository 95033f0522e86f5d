"""The command line."""

from equimorph.cli.app import main as main
