"""Pages of the explorer: how long Python writes one, how large it is, how soon it can be used.

``python benchmarks/explorer.py [ACCURACY ...]``: the arch of the README as it comes, then refined
to each accuracy. Times in the browser are the least of three openings; drawing is by software.
Picks include all that follows: shape, numbers, marks.
"""

import sys
import tempfile
import time
from pathlib import Path
from shutil import which
from typing import Any

from playwright.sync_api import Browser, sync_playwright

import equimorph as em

SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PICKS = """() => { const {view} = explorer, times = [];
for (let k = 0; k < 60; k++) { const start = performance.now();
explorer.hover = view.pick(200 + 6 * k, 150 + 3 * k); explorer.refresh();
times.push(performance.now() - start); } return times.sort((a, b) => a - b)[30]; }"""


def arch(accuracy: float | None) -> em.EquilibriumSet:
    """The set of the README."""
    rod = em.Rod(load="uniform")
    return em.equilibrium_set(
        rod,
        em.Box(Theta=(0.2, 2.5), Delta=(-2.0, 2.0)),
        fixed={"q": 2.5},
        within=[rod.max_curvature <= 20],
        accuracy=accuracy,
    )


def page(browser: Browser, file: Path) -> dict[str, Any]:
    """Milliseconds until the first picture, and of a pick."""
    opened = browser.new_page(viewport={"width": 1200, "height": 800})
    opened.goto(file.as_uri())
    opened.wait_for_selector("html[data-ready]", timeout=300_000)
    ready = float(opened.evaluate("document.documentElement.dataset.ready"))
    found = {"first picture": ready, "pick": opened.evaluate(PICKS)}
    opened.close()
    return found


def main() -> None:
    """Write a row for each accuracy."""
    wanted = [None, *map(float, sys.argv[1:])]
    with sync_playwright() as play, tempfile.TemporaryDirectory() as folder:
        program = which("chromium") or which("google-chrome")
        browser = play.chromium.launch(executable_path=program, args=[*SOFTWARE, "--no-sandbox"])
        for accuracy in wanted:
            eset = arch(accuracy)
            start = time.process_time()
            empty = em.SnapGraph(eset, (), ())
            file = em.explore(eset, path=Path(folder) / "page.html", snaps=empty)
            took, size = time.process_time() - start, file.stat().st_size / 1e6
            found = min(
                (page(browser, file) for _ in range(3)), key=lambda row: row["first picture"]
            )
            row = " · ".join(f"{name} {value:.0f} ms" for name, value in found.items())
            words = f"{len(eset.points)} vertices · {size:.2f} MB · written in {took:.1f} s"
            sys.stdout.write(f"{words} · {row}\n")
        browser.close()


main()
