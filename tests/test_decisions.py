"""docs/decisions.md and the source refer to each other by titles that exist."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
TITLES = set(
    re.findall(
        r"^\*\*(.+?)[.,]?\*\*", (ROOT / "docs" / "decisions.md").read_text(encoding="utf-8"), re.M
    )
)
POLICY = {
    "Dependencies",
    "What a commit checks",
    "Size of the source",
    "The site is built by Sphinx with the PyData theme",
}
"""Decisions that no module of the package carries out."""
LINK = re.compile(r'docs/decisions\.md, ("[^"]+"(?:(?:,| and) "[^"]+")*)')


def _links():
    """Modules by the titles that they refer to; a reference may go over several lines."""
    return {
        title: path
        for path in (ROOT / "src").rglob("*.py")
        for titles in LINK.findall(" ".join(path.read_text(encoding="utf-8").split()))
        for title in re.findall(r'"([^"]+)"', titles)
    }


def test_every_link_from_the_source_leads_to_a_decision():
    """A decision that is renamed or withdrawn takes its links along."""
    links = _links()
    assert len(links) > 20
    assert links.keys() <= TITLES, {t: links[t] for t in links.keys() - TITLES}


def test_every_decision_is_linked_from_the_source_that_it_explains():
    """What no module refers to may no longer hold."""
    assert TITLES - _links().keys() == POLICY
