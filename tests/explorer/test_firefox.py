"""The page in Firefox: the same uses as in Chromium."""

import os
import subprocess
from shutil import which

import numpy as np
import pytest

from marionette import Firefox

pytestmark = pytest.mark.slow
PROGRAM = which("firefox-esr") or which("firefox")
KEYS = {"right": "\ue014", "enter": "\ue007"}
STATE = """(() => { const {set, spot, end} = explorer; return {p: set.parameters(spot), end,
index: set.indexOf(spot), angle: set.scalar(set.named('angle'), spot)}; })()"""
HERE = """(() => { const {view, spot} = explorer, box = view.element.getBoundingClientRect();
const [x, y] = view.eye.project(view.position(spot)); return [box.left + x, box.top + y]; })()"""
TOWARDS = """(() => { const {set, view} = explorer, box = view.element.getBoundingClientRect();
const [x, y] = view.eye.project(view.position(set.walk(explorer.spot, [0.8, 0.05]).spot));
return [box.left + x, box.top + y]; })()"""


@pytest.fixture(scope="module")
def firefox(tmp_path_factory, spring_page):
    """Firefox with the page of the spring; WebGL in it needs a screen, if only a virtual one."""
    if PROGRAM is None:
        pytest.skip("no Firefox is found on this machine")
    server = None
    if "DISPLAY" not in os.environ:
        if which("Xvfb") is None:
            pytest.skip("there is no screen for Firefox, and no Xvfb")
        reading, writing = os.pipe()
        command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", "1280x1024x24"]
        server = subprocess.Popen(command, pass_fds=[writing], stderr=subprocess.DEVNULL)
        display = f":{os.read(reading, 16).decode().strip()}"
    else:
        display = os.environ["DISPLAY"]
    running = Firefox(PROGRAM, tmp_path_factory.mktemp("firefox"), display)
    try:
        running.open(spring_page.as_uri())
        yield running
    finally:
        running.close()
        if server is not None:
            server.terminate()
            server.wait()


def test_a_page_opens_without_asking_for_anything(firefox):
    assert firefox("performance.getEntriesByType('resource').length") == 0
    assert firefox("document.title") == "Spring </script><b>&amp;"


def test_states_of_the_page_are_those_of_the_closed_form(firefox):
    """F = k (1 − x_l/cos δ) sin δ."""
    angles = firefox(
        "explorer.set.over([0.8, 0.03]).map((s) => explorer.set.scalar(explorer.set.named('angle'),"
        " s))"
    )
    assert len(angles) == 3
    for d in angles:
        assert (1.0 - 0.8 / np.cos(d)) * np.sin(d) == pytest.approx(0.03, abs=3e-4)


def test_a_drag_stops_at_the_fold_and_keys_walk_on(firefox):
    """F = (1 − x_l^⅔)^{3/2} at the fold; the tolerance is half a cell."""
    firefox("explorer.goToPoint([0.8, 0.0])")
    firefox("(() => { const e = explorer; while (e.set.scalar(e.set.named('angle'), e.spot) < 0.1"
            " || e.set.indexOf(e.spot)) e.next(); e.view.draw(); })()")  # fmt: skip
    (x, y), (u, v) = firefox(HERE), firefox(TOWARDS)
    firefox.drag([(x + k * (u - x), y + k * (v - y)) for k in range(0, 13, 2)])
    found = firefox(STATE)
    assert found["end"] == "fold"
    fold = (1.0 - found["p"][0] ** (2.0 / 3.0)) ** 1.5
    assert abs(found["p"][1]) == pytest.approx(fold, abs=0.6 / 24)
    firefox("document.querySelector('.view-box').focus()")
    firefox.press("s")
    landed = firefox(STATE)
    assert landed["index"] == 0
    assert landed["angle"] * found["angle"] < 0.0
    firefox("explorer.goToPoint([1.2, 0.1])")
    firefox.press(KEYS["right"], KEYS["enter"])
    assert firefox(STATE)["p"] == pytest.approx([1.21, 0.1], abs=1e-6)
    assert firefox("explorer.pins.length") == 2
