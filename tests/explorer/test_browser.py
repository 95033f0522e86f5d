"""Pages in a browser: they open from the disk, and are used as a person would use them."""

import tomllib
from itertools import pairwise

import numpy as np
import pytest
from typer.testing import CliRunner

import equimorph as em
from equimorph.cli.app import app
from webpages import Opened

STATE = """(() => { const {set, spot, end} = explorer; return {p: set.parameters(spot), end,
index: set.indexOf(spot), angle: set.scalar(set.named('angle'), spot)}; })()"""
LANDING = """(() => { const {set, landing} = explorer; return {released: landing.released,
angle: set.scalar(set.named('angle'), landing.spot)}; })()"""
TOWARDS = """(() => { const {set, view, spot} = explorer;
return view.eye.project(view.position(set.walk(spot, [0.8, 0.05]).spot)); })()"""
"""Pixels of the state to which the load is a little larger."""
NAMELESS = """() => [...document.querySelectorAll(
'button, select, input, [role=application], svg[role=img]')].filter((e) =>
!(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.[0]?.textContent.trim())
).map((e) => e.outerHTML)"""
REACHED = """() => { const e = document.activeElement; e.dataset.seen ??= String(Math.random());
return e.dataset.seen; }"""
CONTROLS = """() => [...document.querySelectorAll('main button, main select, main input')].filter(
(e) => !e.disabled && e.offsetParent).length"""
WIDE = "document.documentElement.scrollWidth"
PLACE = """(p) => { const {set, view} = explorer, box = view.element.getBoundingClientRect();
const [x, y] = view.eye.project(view.position(set.over(p)[0])); return [box.left + x, box.top + y];
}"""
"""Pixels of the window at which the state of least energy over some parameters is drawn."""
UPPER = """() => { const e = explorer; while (e.set.scalar(e.set.named('angle'), e.spot) < 0.1
|| e.set.indexOf(e.spot)) e.next(); }"""
"""Choose the stable state with the larger angle."""
WAIT = """() => new Promise((done) => { const look = () => explorer.player.at > 0 ? done() :
requestAnimationFrame(look); look(); })"""
"""Until the route plays."""


def _fold_load(x):
    """Closed form: F/k = (1 − x^⅔)^{3/2}."""
    return (1.0 - x ** (2.0 / 3.0)) ** 1.5


@pytest.fixture(scope="module")
def spring_once(browser, spring_page):
    page = Opened(browser, spring_page)
    yield page
    page.context.close()


@pytest.fixture
def spring(spring_once):
    """One page for all tests, with one pin, no way, and the route at its start."""
    page = spring_once
    page(
        """() => { const e = explorer; document.querySelector('dialog').close(); e.way = null;
        while (e.pins.length > 1) e.unpin(0); e.player.move(0); e.lookAbove(false); }"""
    )
    yield page
    assert not page.errors


def _focus(page):
    page.page.focus(".view-box")


def test_a_page_opens_without_asking_for_anything(spring):
    """One request: the file itself. The title is text, whatever stands in it."""
    assert [url[:5] for url in spring.requests] == ["file:"]
    assert spring.page.title() == "Spring </script><b>&amp;"
    assert spring("document.querySelector('h1').textContent") == "Spring </script><b>&amp;"
    assert spring("document.querySelector('h1').children.length") == 0


def test_states_of_the_page_are_those_of_the_closed_form(spring):
    """F = k (1 − x_l/cos δ) sin δ at interpolated states, on curved cells."""
    found = spring(
        """() => explorer.set.over([0.8, 0.05]).map((spot) => ({index: explorer.set.indexOf(spot),
        angle: explorer.set.scalar(explorer.set.named('angle'), spot)}))"""
    )
    assert sorted(each["index"] for each in found) == [0, 0, 1]
    for each in found:
        d = each["angle"]
        assert (1.0 - 0.8 / np.cos(d)) * np.sin(d) == pytest.approx(0.05, abs=3e-4)


def test_as_many_states_are_listed_as_there_are(spring):
    """Three inside the cusp, one outside: next to its tip, too, where cells lie overturned."""
    rng = np.random.default_rng(5)
    near = np.array([1.0, 0.0]) + rng.uniform(-1.0, 1.0, (300, 2)) * [0.05, 0.01]
    places = np.concatenate([near, rng.uniform([0.5, -0.25], [1.3, 0.25], (100, 2))])
    fold = np.where(places[:, 0] < 1.0, _fold_load(np.minimum(places[:, 0], 1.0)), 0.0)
    clear = np.abs(np.abs(places[:, 1]) - fold) > 2e-3
    found = spring(
        "(places) => places.map((p) => explorer.set.over(p).length)", places[clear].tolist()
    )
    assert found == np.where(np.abs(places[clear, 1]) < fold[clear], 3, 1).tolist()


def test_the_fields_of_go_there_show_where_the_pin_stands(spring):
    """They showed the middle of the box, wherever the pin was."""
    fields = "() => [...document.querySelectorAll('.go input')].map((each) => Number(each.value))"
    for place in ([0.8, 0.05], [1.2, -0.1]):
        spring("(p) => explorer.goToPoint(p)", place)
        assert spring(fields)[:2] == pytest.approx(place)


def test_the_tree_of_energies_is_that_of_the_closed_form(spring):
    """Both minima are joined ½ (1 − x_l)² above them, at F = 0; beyond x_l = 1 there is one."""
    spring("explorer.goToPoint([0.8, 0.0])")
    spring(UPPER)
    assert "leaves its basin with about" in spring.page.inner_text(".energies .hint")
    assert spring("document.querySelectorAll('.tree .leaf').length") == 2
    move = """(x) => { const [slider] = document.querySelectorAll('.energies input');
    slider.value = x; slider.dispatchEvent(new Event('input'));
    const top = Number(document.querySelector('.tree').getAttribute('aria-label').match(
    /joined at ([0-9]+[.][0-9]+)/)?.[1]); return [explorer.set.parameters(
    explorer.spot)[0], top]; }"""
    for x in (0.7, 0.6):
        assert spring(move, x) == pytest.approx([x, 0.5 * (1.0 - x) ** 2], abs=2e-3)
    spring(move, 1.2)
    assert spring("document.querySelectorAll('.tree .leaf').length") == 1
    assert "No saddle" in spring.page.inner_text(".energies .hint")


def test_a_drag_stops_at_the_fold_and_shows_the_landing(spring):
    """The spring at x_l = 0.8 loses its stability at F = (1 − 0.8^⅔)^{3/2}.

    The tolerance is half a cell of the grid. The energy is released, and following the snap leads
    to the other side.
    """
    page = spring
    page("explorer.goToPoint([0.8, 0.0])")
    page(UPPER)
    page("explorer.view.draw()")
    start = page(STATE)
    x, y = page("explorer.view.eye.project(explorer.view.position(explorer.spot))")
    box = page.page.locator(".view").bounding_box()
    towards = page(TOWARDS)
    mouse = page.page.mouse
    mouse.move(box["x"] + x, box["y"] + y)
    mouse.down()
    for k in (2, 6, 12, 24):
        mouse.move(box["x"] + x + k * (towards[0] - x), box["y"] + y + k * (towards[1] - y))
    mouse.up()
    found = page(STATE)
    assert start["index"] == found["index"] == 0
    assert found["end"] == "fold"
    assert abs(found["p"][1]) == pytest.approx(_fold_load(found["p"][0]), abs=0.6 / 24)
    landing = page(LANDING)
    assert landing["released"] > 0.0
    assert landing["angle"] * found["angle"] < 0.0
    assert "releases" in page.page.inner_text(".says")
    page.page.click("text=Follow the snap")
    assert page(STATE)["angle"] == pytest.approx(landing["angle"])


def test_all_is_done_by_keys(spring):
    """Walk, turn, look from above, next equilibrium, pin, remove, play, lead a way, help."""
    page = spring
    page("explorer.goToPoint([1.2, 0.1])")
    _focus(page)
    press = page.page.keyboard.press
    before = page(STATE)["p"]
    press("ArrowRight")
    press("ArrowUp")
    after = page(STATE)["p"]
    assert after == pytest.approx([before[0] + 0.01, before[1] + 0.006], abs=1e-6)
    camera = page("explorer.view.cameraText")
    press("Shift+ArrowLeft")
    assert page("explorer.view.cameraText") != camera
    press("v")
    press("+")
    press("Enter")
    assert page("explorer.pins.length") == 2
    press("Delete")
    assert page("explorer.pins.length") == 1
    page("explorer.goToPoint([0.8, 0.02])")
    _focus(page)
    angle = page(STATE)["angle"]
    press("n")
    assert page(STATE)["angle"] != pytest.approx(angle)
    page("explorer.goToPoint([1.2, 0.1])")
    _focus(page)
    press("w")
    press("ArrowLeft")
    press("w")
    assert page("explorer.way.legs.length") == 1
    press("Space")
    page(WAIT)
    press("Space")
    press("?")
    assert page.page.is_visible("dialog")
    press("Escape")
    assert not page.page.is_visible("dialog")


def test_pointing_at_the_set_shows_a_state_until_the_pointer_leaves(spring):
    """Its numbers stand in a column of their own, and nothing is pinned."""
    pins = spring("explorer.pins.length")
    spring("explorer.view.draw()")
    spring.page.mouse.move(*spring(PLACE, [1.2, 0.1]))
    spring.page.wait_for_function("explorer.hover")
    assert spring("explorer.set.parameters(explorer.hover)") == pytest.approx([1.2, 0.1], abs=0.01)
    assert "pointer" in spring.page.inner_text(".numbers thead")
    assert spring("explorer.pins.length") == pins
    spring.page.mouse.move(5, 5)
    spring.page.wait_for_function("!explorer.hover")


@pytest.mark.parametrize(
    ("key", "change"),
    [
        ("ArrowLeft", [-0.01, 0.0]), ("ArrowRight", [0.01, 0.0]), ("ArrowDown", [0.0, -0.006]),
        ("ArrowUp", [0.0, 0.006]), ("Alt+ArrowUp", [0.0, 0.0006]), ("PageUp", [0.0, 0.0]),
        ("PageDown", [0.0, 0.0]),
    ],
)  # fmt: skip
def test_arrow_keys_walk_by_a_hundredth_of_the_box(spring, key, change):
    """Alt walks by a thousandth; there is no third parameter."""
    spring("explorer.goToPoint([1.2, 0.1])")
    _focus(spring)
    spring.page.keyboard.press(key)
    assert spring(STATE)["p"] == pytest.approx(np.add([1.2, 0.1], change).tolist(), abs=1e-6)


@pytest.mark.parametrize(
    "key", [*(f"Shift+Arrow{way}" for way in ("Left", "Right", "Up", "Down")), "+", "=", "-", "v"]
)
def test_keys_turn_and_move_the_set(spring, key):
    before = spring("explorer.view.cameraText")
    _focus(spring)
    spring.page.keyboard.press(key)
    assert spring("explorer.view.cameraText") != before
    assert spring("explorer.spot === explorer.pins[explorer.current].spot")


def test_every_control_has_a_name_and_can_be_reached(spring):
    """Buttons, fields and the set itself are named, and the tab key meets all of them."""
    nameless = spring(NAMELESS)
    assert nameless == []
    wanted = spring(CONTROLS)
    spring("document.activeElement.blur()")
    seen = set()
    for _ in range(wanted + 4):
        spring.page.keyboard.press("Tab")
        seen.add(spring(REACHED))
    assert len(seen) >= wanted
    assert spring("document.querySelector('.says').getAttribute('aria-live')") == "polite"


def test_nothing_is_wider_than_the_window(spring):
    assert spring(WIDE) <= 1000


def test_a_state_in_the_address_comes_back_on_a_phone(opened, spring_page, spring):
    """Pins, colour, place on the route and theme; nothing is wider there; a tap pins a state."""
    spring("explorer.goToPoint([0.8, 0.05])")
    spring("explorer.setColour(explorer.set.named('energy'))")
    spring("explorer.player.move(0.25)")
    spring("explorer.switchAppearance()")
    fragment = spring("'#' + explorer.linkText")
    again = opened(spring_page, fragment, viewport={"width": 390, "height": 800}, has_touch=True)
    assert again(STATE)["p"] == pytest.approx(spring(STATE)["p"], abs=1e-6)
    assert again(STATE)["angle"] == pytest.approx(spring(STATE)["angle"], abs=1e-6)
    assert again("explorer.linkText") == fragment[1:]
    assert again(WIDE) <= 390
    again("explorer.lookAbove(true)")
    again("explorer.view.draw()")
    x, y = again(PLACE, [1.2, 0.1])
    again.page.touchscreen.tap(x, y)
    assert again("explorer.pins.length") == 2
    assert again(STATE)["p"] == pytest.approx([1.2, 0.1], abs=0.02)


AROUND = ([0.8, -0.02], [1.2, -0.05], [1.2, 0.05], [0.8, 0.02], [0.8, -0.009908])
"""Way-points around the cusp at x_l = 1."""


def _export(page, file):
    """Lead the spring around its cusp, and save the study that the page writes."""
    page("explorer.goToPoint([0.8, 0.009908])")
    page(UPPER)
    page("explorer.beginWay()")
    for target in AROUND:
        page("(p) => explorer.leadWay(p)", target)
    verdict = page.page.inner_text(".way .verdict")
    with page.page.expect_download() as download:
        page.page.click("text=Export study")
    download.value.save_as(file)
    return verdict


def test_a_drawn_way_is_exported_as_a_sound_study(spring, tmp_path):
    """`equimorph check` accepts the file; its way-points are those of the page."""
    file = tmp_path / "drawn.toml"
    verdict = _export(spring, file)
    assert verdict.startswith("Coarse: Stable")
    text = tomllib.loads(file.read_text(encoding="utf-8"))
    assert [list(each.values()) for each in text["route"][0]["via"]] == list(map(list, AROUND))
    done = CliRunner().invoke(app, ["check", str(file)])
    assert done.exit_code == 0, done.output


@pytest.mark.slow
def test_python_certifies_the_way_that_was_drawn(spring, tmp_path):
    """The exported route arrives, and the same steps are verified without the set."""
    file = tmp_path / "drawn.toml"
    _export(spring, file)
    outcome = em.study.run_study(file, tmp_path / "out")
    assert not outcome.refused
    assert outcome.of("route")["drawn"][0].arrived
    assert outcome.of("verify")["check"].verified


def test_a_way_over_a_fold_is_called_blocked(spring):
    """A coarse verdict names the obstacle and its place."""
    page = spring
    page("explorer.goToPoint([0.8, 0.0])")
    page("() => { while (explorer.set.indexOf(explorer.spot)) explorer.next(); }")
    page("explorer.beginWay()")
    sign = 1 if page(STATE)["angle"] < 0 else -1
    page("(p) => explorer.leadWay(p)", [0.8, 0.2 * -sign])
    ends = [page("explorer.way.legs[0].end")]
    if ends[0] != "fold":
        page("() => { explorer.way.remove(); }")
        page("(p) => explorer.leadWay(p)", [0.8, 0.2 * sign])
        ends.append(page("explorer.way.legs[0].end"))
    assert "fold" in ends
    assert "fold" in page.page.inner_text(".way .verdict")


def test_strips_and_progress_go_in_step(spring):
    """Progress along the route is even in its length."""
    shares = spring("explorer.player.route.at")
    assert shares[0] == 0.0
    assert shares[-1] == pytest.approx(1.0)
    assert all(a <= b for a, b in pairwise(shares))
    spring("explorer.player.move(0.5)")
    margin = float(spring.page.inner_text(".strips figure:first-child output").replace("−", "-"))
    exact = spring(
        "explorer.set.scalar(explorer.set.named('stability_margin'), explorer.player.spot)"
    )
    assert margin == pytest.approx(exact, rel=1e-3)
