"""``equimorph paper``: reproduce the article and compare its numbers with ours."""

from pathlib import Path

from rich.console import Console
from rich.table import Table

from equimorph.paper import reproduce
from equimorph.paper.reproduction import in_words
from equimorph.progress import ProgressBars


def reproduce_and_show(out: Path) -> None:
    """Reproduce the article in a folder with progress on stderr, then print the report's path."""
    screen = Console(highlight=False)
    with ProgressBars() as progress:
        found = reproduce(out, progress=progress)
    rows = [row for example in found.numbers for row in found.rows(example)]
    table = Table(box=None, header_style="bold")
    for title in ("what", "theirs", "ours"):
        table.add_column(title, justify="left" if title == "what" else "right")
    for quoted, ours in rows:
        asked = isinstance(quoted.theirs, bool)
        theirs, own = in_words(quoted.theirs, 6), in_words(bool(ours) if asked else ours, 6)
        table.add_row(quoted.what, theirs, own)
    screen.print(table)
    screen.print(f"Report: {out / 'index.html'}", soft_wrap=True)
