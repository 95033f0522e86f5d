"""A browser without a screen, and pages to open in it."""

from collections.abc import Iterator
from pathlib import Path
from shutil import which
from typing import Any

import pytest

import equimorph as em
from webpages import Opened

CHROMIUM = which("chromium") or which("chromium-browser") or which("google-chrome")
SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
"""Drawing in 3-D without a graphics processor."""


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Chromium, driven by playwright."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("no Chromium is found on this machine")
    with api.sync_playwright() as play:
        running = play.chromium.launch(executable_path=CHROMIUM, args=[*SOFTWARE, "--no-sandbox"])
        yield running
        running.close()


@pytest.fixture
def opened(browser: Any) -> Iterator[Any]:
    """A function that opens pages; what they report as errors fails the test."""
    pages: list[Opened] = []

    def open_page(path: Path, fragment: str = "", **context: Any) -> Opened:
        pages.append(Opened(browser, path, fragment, **context))
        return pages[-1]

    yield open_page
    for each in pages:
        each.context.close()
    assert not [error for each in pages for error in each.errors]


@pytest.fixture(scope="session")
def spring_set() -> em.EquilibriumSet:
    """The spring around its cusp, whose states are known in closed form."""
    box = em.Box(x_l=(0.4, 1.4), F=(-0.3, 0.3))
    return em.equilibrium_set(em.Spring(), box, intervals=(24, 24), checks=0)


@pytest.fixture(scope="session")
def spring_page(spring_set: em.EquilibriumSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The spring with a route from side to side and the barriers of least energy."""
    here = spring_set.at(x_l=0.8, F=0.0)
    angle = spring_set.structure.descriptor("angle")
    start, goal = max(here.stable, key=angle), min(here.stable, key=angle)
    route = em.plan(spring_set, start, goal, margin=0.02)
    folder = tmp_path_factory.mktemp("explorer")
    return em.explore(
        em.barriers(spring_set),
        {"around": route},
        folder / "spring.html",
        title="Spring </script><b>&amp;",
        reduction=em.reduce(
            spring_set, prefer=em.charts.lowest(spring_set.structure.descriptor("energy"))
        ),
    )
