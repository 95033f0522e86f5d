"""Commands: parse, call, show.

Everything heavy is imported inside the command that needs it, so that ``--help`` answers at once.
"""

import logging
import sys
import warnings
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from equimorph.errors import InputError

PROGRAM = "equimorph"
BAD_INPUT = 2
"""Exit code of a command with wrong input; Python itself uses 1 for a crash."""
LONGEST_LINE = 450
"""Characters of an error message on the command line, beyond which it is cut."""
INTERRUPTED = 130
"""What shells say of a program that was ended by Ctrl-C."""
LIBRARIES = ("matplotlib", "numba", "PIL", "h5py")
"""Names of the loggers of libraries."""
WrongUsage: Any = typer.BadParameter.__base__
"""Class of all complaints about words on the command line; typer does not name it."""

app = typer.Typer(
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Quasi-static shape control of soft, morphing structures.",
)


class Kind(StrEnum):
    """Kinds of studies that can be begun."""

    arch = "arch"
    arm = "arm"
    beam = "beam"
    bridge = "bridge"
    calibration = "calibration"
    column = "column"
    deep_arch = "deep_arch"
    drive = "drive"
    lee = "lee"
    maps = "maps"
    network = "network"
    spring = "spring"
    stack = "stack"
    bistable_strip = "strip"  # a member called strip would hide that of str
    tasks = "tasks"
    truss = "truss"


def quiet_libraries() -> None:
    """Keep to itself what libraries warn of, like a font that is missing: users cannot act on it.

    Warnings that are asked for, by ``python -W`` or ``PYTHONWARNINGS``, are shown.
    """
    for name in LIBRARIES:
        logging.getLogger(name).setLevel(logging.ERROR)
    if not sys.warnoptions:
        warnings.simplefilter("ignore")


def main() -> None:
    """Run the command line: what cannot be done is one line on stderr and exit code 2."""
    words = sys.argv[1:]
    quiet_libraries()
    try:
        code = app(words or ["--help"], prog_name=PROGRAM, standalone_mode=False)
    except WrongUsage as error:
        command = error.ctx.command_path if error.ctx else PROGRAM
        _complain(f"{error.format_message()} See {command} --help.")
        sys.exit(BAD_INPUT)
    except InputError as error:
        _complain(str(error))
        sys.exit(BAD_INPUT)
    except (typer.Abort, KeyboardInterrupt):
        _complain("interrupted.")
        sys.exit(INTERRUPTED)
    except MemoryError:
        _complain("the computation must fit into memory; reduce `set.intervals` or `set.box`.")
        sys.exit(BAD_INPUT)
    sys.exit((code or 0) if words else BAD_INPUT)


def _complain(message: str) -> None:
    """Write one line, fit for a terminal: names from a file may hold any character."""
    printable = "".join(each if each.isprintable() else " " for each in message)
    line = " ".join(printable.split())
    line = line if len(line) <= LONGEST_LINE else line[: LONGEST_LINE - 3] + "..."
    sys.stderr.write(f"equimorph: {line}\n")


def _show_version(wanted: bool) -> bool:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"equimorph {version('equimorph')}")
        raise typer.Exit
    return wanted


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    pass


@app.command()
def new(
    file: Annotated[Path, typer.Argument(help="Study file to write, say my-arch.toml.")],
    kind: Annotated[
        Kind,
        typer.Option(
            help="What to begin with: a rod (arch, arm, beam, deep_arch, strip), a frame (lee, "
            "network), a truss (bridge, drive, stack, truss), an energy (column), maps, "
            "the spring, measured shapes (calibration), or every question that there is (tasks)."
        ),
    ] = Kind.arch,
) -> None:
    """Begin a study: write an example file to change."""
    from equimorph.study.template import write_template

    write_template(file, kind.value)
    typer.echo(f"Wrote {file}. Next: equimorph run {file}")


@app.command()
def check(file: Annotated[Path, typer.Argument(help="Study file.")]) -> None:
    """Check a study file without computing anything."""
    from equimorph.cli.check import check_and_show

    check_and_show(file)


@app.command()
def run(
    file: Annotated[Path, typer.Argument(help="Study file.")],
    out: Annotated[
        Path | None, typer.Option(help="Results folder; results/NAME unless given.")
    ] = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace the results of another study there.")
    ] = False,
) -> None:
    """Run a study: equilibrium set, equilibria, routes, figures, schedules, report."""
    out = out or Path("results") / file.stem
    try:
        from equimorph.cli.run import run_and_show

        run_and_show(file, out, replace=replace)
    except KeyboardInterrupt as stop:
        kept = str(stop) or f"what is finished is kept in {out}"
        typer.echo(f"equimorph: interrupted; {kept}. Run again to go on.", err=True)
        raise typer.Exit(INTERRUPTED) from None


@app.command()
def paper(
    out: Annotated[Path, typer.Option(help="Folder for figures and the report.")] = Path(
        "results/paper"
    ),
) -> None:
    """Reproduce the figures and tables of the article, and compare the numbers."""
    from equimorph.cli.paper import reproduce_and_show

    reproduce_and_show(out)
