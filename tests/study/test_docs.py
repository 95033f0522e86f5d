"""The guide to study files names every table, and its pieces are sound."""

import re
from pathlib import Path

import pytest

from equimorph.study import parse_study, prepare
from equimorph.study.kinds import KINDS
from equimorph.study.reference import reference

GUIDE = (Path(__file__).parents[2] / "docs" / "studies.md").read_text(encoding="utf-8")
PIECES = re.findall(r"```toml\n(.*?)```", GUIDE, re.DOTALL)
SPRING = '[structure]\nkind = "spring"\n[set]\nbox = { x_l = [0.5, 1.3], F = [-0.2, 0.2] }\n'
ARCH = '[structure]\nkind = "rod"\nload = "uniform"\n'
STRUCTURES = {"quick": SPRING, "heights": SPRING, "uniform": ARCH}


def test_the_guide_names_every_table():
    assert all(f"`[[{kind.table}]]`" in GUIDE for kind in KINDS)


@pytest.mark.parametrize("piece", PIECES, ids=lambda piece: piece.split('"')[1])
def test_a_piece_of_the_guide_is_a_sound_study(piece: str):
    name = piece.split('"')[1]
    if name not in STRUCTURES:  # the bridge is long: its keys are checked, not its names
        parse_study(ARCH + piece, "guide.toml")
        return
    assert prepare(parse_study(STRUCTURES[name] + piece, "guide.toml")).questions


def _keys(page: str) -> list[str]:
    """Tables, keys and defaults of the page, without the words of docstrings."""
    lines = (line.rsplit(" | ", 1)[0] for line in page.splitlines())
    return [line for line in lines if line.startswith(("##", "|"))]


def test_the_page_of_keys_is_that_of_the_signatures():
    """`python -m equimorph.study.reference > docs/study-keys.md` writes it anew."""
    page = Path(__file__).parents[2] / "docs" / "study-keys.md"
    assert _keys(page.read_text(encoding="utf-8")) == _keys(reference())


def test_every_key_has_a_meaning():
    assert [line for line in reference().splitlines() if line.endswith("|  |")] == []
