"""The command line."""

import sys


def main() -> None:
    """Run the command line; Ctrl-C while its modules are imported is one line, too."""
    try:
        from equimorph.cli.app import main as run
    except KeyboardInterrupt:
        sys.stderr.write("equimorph: interrupted; nothing had begun.\n")
        sys.exit(130)
    run()
