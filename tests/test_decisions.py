"""docs/decisions.md and the source refer to each other by titles that exist."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
TITLES = set(
    re.findall(
        r"^\*\*(.+?)[.,]?\*\*", (ROOT / "docs" / "decisions.md").read_text(encoding="utf-8"), re.M
    )
)
LINK = re.compile(r'See docs/decisions\.md, "([^"]+)"')


def test_every_link_from_the_source_leads_to_a_decision():
    """A decision that is renamed or withdrawn takes its links along."""
    links = {
        title: path
        for path in (ROOT / "src").rglob("*.py")
        for title in LINK.findall(path.read_text(encoding="utf-8"))
    }
    assert len(links) > 20
    assert links.keys() <= TITLES, {t: links[t] for t in links.keys() - TITLES}
