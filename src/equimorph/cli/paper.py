"""``equimorph paper``: reproduce the article and compare its numbers with ours."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from equimorph.cli.progress import ScreenProgress
from equimorph.paper import reproduce


def reproduce_and_show(out: Path) -> None:
    """Reproduce the article with progress on stderr, then print the path of the report.

    Parameters
    ----------
    out
        Folder for figures and the report.
    """
    screen = Console(highlight=False)
    with ScreenProgress() as progress:
        found = reproduce(out, progress=progress)
    rows = [row for example in found.numbers for row in found.rows(example)]
    table = Table(box=None, header_style="bold")
    for title in ("what", "theirs", "ours"):
        table.add_column(title, justify="left" if title == "what" else "right")
    for quoted, ours in rows:
        table.add_row(quoted.what, f"{quoted.theirs:g}", f"{ours:.6g}")
    screen.print(table)
    screen.print(f"Report: {out / 'index.html'}", soft_wrap=True)
