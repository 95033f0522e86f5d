"""The command line.

See docs/decisions.md, "The command line gives OpenBLAS one thread".
"""

import os
import sys


def main() -> None:
    """Run the command line; Ctrl-C while its modules are imported is one line, too.

    OpenBLAS has one thread unless the environment says otherwise: our kernels have their own.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from equimorph.cli.app import main as run
    except KeyboardInterrupt:
        sys.stderr.write("equimorph: interrupted; nothing had begun.\n")
        sys.exit(130)
    run()
