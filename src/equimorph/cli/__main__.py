"""The command line as ``python -m equimorph.cli``."""

from equimorph.cli import main

main()
