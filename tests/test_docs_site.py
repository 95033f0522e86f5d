"""Pages of the documentation: examples run, all names are there, links lead somewhere."""

import re
import sys
from pathlib import Path

import pytest

import equimorph as em
from typecheck import unchecked

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS / "extensions"))
from public_names import descriptors_of, groups, slug  # noqa: E402

FOLDERS = ("tutorial", "reference", "compared")
RUN = [page for folder in FOLDERS for page in DOCS.glob(f"{folder}/*.md")]
PAGES = [page for page in (*DOCS.glob("*.md"), *RUN) if not page.name.endswith(".inc.md")]
GENERATED = ("reference/names/", "reference/descriptors.md", "gallery/")
BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)
LINK = re.compile(r"(?<!`)\[[^\]]*\]\(([^)\s]+)\)")
SAID = re.compile(r"^ *(?:print\(.*|\))  # (.*)$", re.MULTILINE)
"""What a call of print, in one line or several, says that it prints."""
QUICK = {"errors", "map-limit-loads", "sections-materials-and-loads", "strip", "truss"}
RUN = [page for page in RUN if BLOCK.search(page.read_text(encoding="utf-8"))]


def _code(page: Path) -> str:
    return "".join(BLOCK.findall(page.read_text(encoding="utf-8")))


def _heading(title: str) -> str:
    """The anchor of a heading."""
    words = re.sub(r"[^\w\s-]", "", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title).lower())
    return re.sub(r"\s", "-", words.strip())


def _anchors(page: Path) -> set[str]:
    text = page.read_text(encoding="utf-8")
    keys = {key.lower() for key in re.findall(r"^- \*\*\[(\w+)\]\*\*", text, re.M)}
    return keys | {_heading(title) for title in re.findall(r"^#+ (.*)$", text, re.M)}


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=() if page.stem in QUICK else pytest.mark.slow)
        for page in sorted(RUN)
    ],
    ids=lambda page: page.stem,
)
def test_a_page_prints_what_it_says(page, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = _code(page)
    with unchecked():  # the tests of what it calls check shapes
        exec(compile(code, str(page), "exec"), {})  # our own text
    printed = [line.split(" ") for line in capsys.readouterr().out.splitlines()]
    said = SAID.findall(code)
    assert len(printed) == len(said)
    for line, words in zip(printed, said, strict=True):
        told = words.removesuffix(" …").split(" ")
        assert line[: len(told)] == told


@pytest.mark.parametrize("title", groups())
def test_every_name_has_an_example(title):
    """In its own docstring, or in the one of its group: both are run."""
    code = _code(DOCS / "reference" / f"{slug(title)}.md")
    shown = re.compile(rf"\b({'|'.join(groups()[title])})\b").findall(code)
    missing = [name for name in groups()[title] if name not in shown]
    assert [name for name in missing if ">>>" not in (getattr(em, name).__doc__ or "")] == []


def test_every_public_name_stands_in_one_group():
    names = [name for group in groups().values() for name in group]
    assert len(names) == len(set(names)) > 150
    assert {name for name in em.__all__ if name not in names} == {
        name for name in em.__all__ if type(getattr(em, name)).__name__ in ("module", "str")
    }


def test_every_group_stands_in_the_index():
    index = (DOCS / "reference" / "index.md").read_text(encoding="utf-8").split()
    assert [title for title in groups() if slug(title) not in index] == []


def test_descriptors_of_structures_are_found():
    assert {"height", "max_curvature", "angle", "position"} <= set(descriptors_of(em.Rod))
    assert {"force", "displacement", "max_utilisation"} <= set(descriptors_of(em.Truss))


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md"], ids=lambda page: page.name)
def test_no_link_is_dead(page):
    dead = []
    for link in LINK.findall(BLOCK.sub("", page.read_text(encoding="utf-8"))):
        target, _, anchor = link.partition("#")
        place = (page.parent / target).resolve() if target else page
        inside = place.relative_to(DOCS).as_posix() if place.is_relative_to(DOCS) else ""
        if "://" in link or inside.startswith(GENERATED):
            continue  # the build of the site checks generated pages
        if not place.exists() or (anchor and anchor not in _anchors(place)):
            dead.append(link)
    assert dead == []
