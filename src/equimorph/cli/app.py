"""Commands: parse, call, show.

Everything heavy is imported inside the command that needs it, so that ``--help`` answers at once.
"""

import gc
import json
import logging
import sys
import warnings
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager
from enum import StrEnum
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any

import typer

from equimorph.errors import InputError, LostWorkersError

PROGRAM = "equimorph"
BAD_INPUT = 2
"""Exit code of a command with wrong input; Python itself uses 1 for a crash."""
REFUSED = 3
"""Exit code of a run in which a question was refused."""
LONGEST_LINE = 450
"""Characters of an error message on the command line, beyond which it is cut."""
INTERRUPTED = 130
"""What shells say of a program that was ended by Ctrl-C."""
OUT_OF_MEMORY = "the computation must fit into memory; reduce `set.intervals` or `set.box`."
LIBRARIES = ("matplotlib", "numba", "PIL", "h5py")
"""Names of the loggers of libraries."""
WrongUsage: Any = typer.BadParameter.__base__
"""Class of all complaints about words on the command line; typer does not name it."""

app = typer.Typer(
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Quasi-static shape control of soft, morphing structures.",
)


TEMPLATES = Path(__file__).parents[1] / "study" / "templates"
Kind = StrEnum(  # type: ignore[misc]  # a member called strip would hide that of str
    "Kind", [(f"{each.stem}_study", each.stem) for each in sorted(TEMPLATES.glob("*.toml"))]
)
"""Kinds of studies that can be begun."""
ARCH = Kind("arch")


class InterruptedRunError(Exception):
    """Ctrl-C ended a run; the message says what is kept."""


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
    except InterruptedRunError as stop:
        _complain(f"interrupted; {stop}. Run again to go on.")
        sys.exit(INTERRUPTED)
    except (typer.Abort, KeyboardInterrupt):
        code = INTERRUPTED
    except MemoryError:
        _complain(OUT_OF_MEMORY)
        sys.exit(BAD_INPUT)
    if code == INTERRUPTED:  # typer says nothing itself
        _complain("interrupted; nothing had begun.")
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
            "the spring, measured shapes (calibration), motions in time (motion), or every "
            "question that there is (tasks)."
        ),
    ] = ARCH,
) -> None:
    """Begin a study: write an example file to change."""
    from equimorph.study.template import write_template

    write_template(file, kind.value)
    typer.echo(f"Wrote {file}. Next: equimorph run {file}")


@app.command()
def schema() -> None:
    """Write the JSON schema of study files to stdout, for editors."""
    from equimorph.study.schema import schema_text

    typer.echo(schema_text(), nl=False)


Files = Annotated[list[Path], typer.Argument(help="Study files.", metavar="FILE...")]
AsJson = Annotated[
    bool, typer.Option("--json", help="Write one JSON object per study on stdout, one a line.")
]


@app.command()
def check(files: Files, as_json: AsJson = False) -> None:
    """Check study files without computing anything; every mistake gets a line."""
    from equimorph.cli.check import check_and_show

    codes = []
    for file in files:
        command = partial(check_and_show, file, as_json=as_json)
        codes.append(_exit_code(command, file, as_json=as_json, all_mistakes=True))
    raise typer.Exit(_worst(codes))


@app.command()
def run(
    files: Files,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Results folder; results/NAME unless given. Of several studies: the folder in "
            "which each gets one of its name."
        ),
    ] = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace the results of another study there.")
    ] = False,
    as_json: AsJson = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Show mistakes only; no answers, no progress.")
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Log every stage with its time on stderr.")
    ] = False,
    allow_refused: Annotated[
        bool, typer.Option("--allow-refused", help="Exit code 0 where questions are refused.")
    ] = False,
    cluster: Annotated[
        str,
        typer.Option(
            help="Compute the rays of maps and the trials on a cluster of Dask: local:n for n "
            "processes here, or the address of a scheduler, like tcp://host:8786."
        ),
    ] = "",
) -> None:
    """Run studies: equilibrium set, equilibria, routes, figures, schedules, report.

    The exit code is 0 if every question was answered, 3 if one was refused, 2 if an input is wrong;
    of several studies the worst.
    """
    if quiet and verbose:
        raise typer.BadParameter("give one of --quiet and --verbose.")
    options = {"replace": replace, "as_json": as_json, "quiet": quiet, "verbose": verbose}
    codes = []
    with _workers_of(cluster) as workers:
        for file, folder in _folders(files, out):
            command = partial(_run_one, file, folder, workers, **options)
            codes.append(_exit_code(command, file, as_json=as_json))
    raise typer.Exit(_worst(0 if allow_refused and code == REFUSED else code for code in codes))


@app.command("compile")
def compile_kernels(
    files: Annotated[
        list[Path] | None, typer.Argument(help="Study files; all kernels without.", metavar="FILE")
    ] = None,
) -> None:
    """Compile the kernels that studies need, or all, so that no run has to wait for it."""
    from equimorph.cli.run import compile_all_of

    compile_all_of(files or [])


@app.command()
def replay(
    file: Annotated[Path, typer.Argument(help="Schedule, a table with its sidecar.")],
    rate: Annotated[
        float | None, typer.Option(help="Speed in the scaled parameters, of a schedule untimed.")
    ] = None,
    simulator: Annotated[str, typer.Option(help="mujoco, or own: not independent.")] = "mujoco",
    links: Annotated[int, typer.Option(help="Links of each chain.")] = 40,
    picture: Annotated[
        Path | None, typer.Option(help="File for a figure of the deviation over time.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Replay a schedule in time in MuJoCo; exit code 3 if the structure snaps."""
    from equimorph.cli.replay import as_json as numbers, lines, replay_file

    played = replay_file(file, rate=rate, simulator=simulator, links=links, picture=picture)
    for line in [numbers(played)] if as_json else lines(played):
        typer.echo(line)
    raise typer.Exit(REFUSED if played.snapped else 0)


def _folders(files: list[Path], out: Path | None) -> list[tuple[Path, Path]]:
    """Pair each study with its results folder."""
    names = [file.stem for file in files]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InputError(f"`study files` must have different names; got {twice[0]} twice.")
    if out is not None and len(files) == 1:
        return [(files[0], out)]
    return [(file, (out or Path("results")) / file.stem) for file in files]


@contextmanager
def _workers_of(cluster: str) -> Generator[Any]:
    """Give the workers of a cluster while a block lasts; None without one."""
    if not cluster:
        yield None
        return
    from equimorph.cluster import connect

    with connect(cluster) as workers:
        yield workers


@cache
def _import_uncollected() -> None:
    """Import what runs studies; the garbage collector never looks at what these modules define."""
    gc.disable()
    import equimorph.cli.output
    import equimorph.cli.run  # noqa: F401  # modules are wanted, not names

    gc.freeze()
    gc.enable()


def _run_one(file: Path, out: Path, workers: Any, *, replace: bool, **shown: bool) -> int:
    """Run one study; return its exit code."""
    try:
        _import_uncollected()
        from equimorph.cli.output import Output
        from equimorph.cli.run import run_and_show

        output = Output(**shown)
        refused = run_and_show(file, out, output, replace=replace, workers=workers)
        return REFUSED if refused else 0
    except KeyboardInterrupt as stop:
        raise InterruptedRunError(str(stop) or f"what is finished is kept in {out}") from None


def _exit_code(
    command: Callable[[], int], file: Path, *, as_json: bool, all_mistakes: bool = False
) -> int:
    """Run a command on one study; a wrong one gets a line, or all its lines, and exit code 2."""
    try:
        return command()
    except (InputError, LostWorkersError) as error:
        mistakes = tuple(getattr(error, "lines", ())) or (str(error),)
        lines = mistakes if all_mistakes else (str(error),)
    except MemoryError:
        mistakes = lines = (OUT_OF_MEMORY,)
    if as_json:
        typer.echo(json.dumps({"study": str(file), "errors": mistakes}))
    for line in lines:
        _complain(line)
    return BAD_INPUT


def _worst(codes: Iterable[int]) -> int:
    """Return the exit code of several studies: wrong input, then refusals, then success."""
    found = set(codes)
    return next((code for code in (BAD_INPUT, REFUSED) if code in found), 0)


@app.command()
def paper(
    out: Annotated[Path, typer.Option(help="Folder for figures and the report.")] = Path(
        "results/paper"
    ),
) -> None:
    """Reproduce the figures and tables of the article, and compare the numbers."""
    from equimorph.cli.paper import reproduce_and_show

    reproduce_and_show(out)
