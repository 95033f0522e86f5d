"""The notebooks run, and print what they show."""

import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted((Path(__file__).parents[1] / "docs" / "notebooks").glob("*.ipynb"))


def printed(notebook: nbformat.NotebookNode) -> list[list[str]]:
    """Kinds of the outputs of each cell of code, and what is printed."""
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    return [
        [str(each.get("text", sorted(each.get("data", {})))) for each in cell.outputs]
        for cell in cells
    ]


def test_there_are_three_notebooks():
    assert [file.stem for file in NOTEBOOKS] == ["arch", "strip", "truss"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the messages between notebook and kernel
@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_a_notebook_runs_and_prints_what_it_shows(file):
    shown = nbformat.read(file, as_version=4)
    again = nbformat.from_dict(shown)
    NotebookClient(again, timeout=300, kernel_name="python3").execute()
    assert printed(again) == printed(shown)
    assert any("image/png" in each for outputs in printed(shown) for each in outputs)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the messages between notebook and kernel
def test_a_notebook_shows_bars_of_progress():
    """One display with a bar for each stage, those before the last at their ends; no other text."""
    cell = """
import equimorph as em
with em.ProgressBars() as bars:
    box = em.Box(x_l=(0.6, 1.4), F=(-0.3, 0.3))
    em.equilibrium_set(em.Spring(), box, progress=bars)
"""
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell)])
    NotebookClient(book, timeout=120, kernel_name="python3").execute()
    (shown,) = [each for each in book.cells[0].outputs if each.output_type == "display_data"]
    assert [each.get("name") for each in book.cells[0].outputs].count("stderr") == 0
    bars = re.findall(
        r'<td>([a-z ]+)</td><td><progress value="(\d+)" max="(\d+)">', shown.data["text/html"]
    )
    assert len(bars) >= 3
    assert all(int(done) == int(total) for _, done, total in bars[:-1])
