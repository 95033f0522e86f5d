"""docs/architecture.md names modules of the source; each of them exists."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
PLACES = ("", "src/equimorph", "src/equimorph/manifold", "src/equimorph/manifold/lifting")
MODULES = sorted(set(re.findall(r"`([\w/]+\.pyi?)`", TEXT)))


def test_the_page_names_modules():
    """The pattern below finds something."""
    assert len(MODULES) > 20


@pytest.mark.parametrize("name", MODULES)
def test_every_module_named_on_the_page_exists(name):
    """A module that moves takes its mention along."""
    assert any((ROOT / place / name).is_file() for place in PLACES)
