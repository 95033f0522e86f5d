"""Pages of one and of three parameters, of structures in space: each opened once."""

import numpy as np
import pytest

import equimorph as em
from webpages import Opened

FIXED, RISE = 0.8, 0.3
"""Distance of the supports of the spring; height of the tripod."""
STATE = """(() => { const {set, spot, end} = explorer; return {p: set.parameters(spot), end,
index: set.indexOf(spot), height: set.scalar(explorer.view.height, spot)}; })()"""
LEVELS = """() => { const {view, set} = explorer, found = [];
for (let x = 20; x < 500; x += 40) for (let y = 20; y < 300; y += 20) {
  const spot = view.pick(x, y); if (spot) found.push(set.parameters(spot)[2]); }
return found; }"""
"""Third parameters of the states under a grid of pixels."""
PICKED = """() => { const {view, set} = explorer, found = [];
for (let x = 20; x < 500; x += 20) for (let y = 20; y < 300; y += 20) {
  const spot = view.pick(x, y); if (spot) found.push([set.parameters(spot)[0],
    set.scalar(view.height, spot), set.indexOf(spot)]); }
return found; }"""
SHAPE = "document.querySelector('svg.shape').innerHTML"


@pytest.fixture(scope="module")
def line(browser, tmp_path_factory):
    """The spring over its load alone."""
    box = em.Box(F=(-0.2, 0.2))
    eset = em.equilibrium_set(em.Spring(), box, fixed={"x_l": FIXED}, intervals=(24,), checks=0)
    page = Opened(browser, em.explore(eset, path=tmp_path_factory.mktemp("line") / "line.html"))
    yield page
    page.context.close()
    assert not page.errors


@pytest.fixture(scope="module")
def volume(browser, tmp_path_factory):
    """Three bars in space under loads along all three axes."""
    angles = np.array([0.0, 2.0, 4.0]) * np.pi / 3.0
    feet = {f"A{i}": (np.cos(a), np.sin(a), 0.0) for i, a in enumerate(angles)}
    forces = {f"F_{x}": {"T": np.eye(3)[k].tolist()} for k, x in enumerate("xyz")}
    bars, held = [(foot, "T") for foot in feet], dict.fromkeys(feet, "xyz")
    truss = em.Truss({**feet, "T": (0, 0, RISE)}, bars, held, forces)
    box = em.Box(F_x=(-0.01, 0.01), F_y=(-0.01, 0.01), F_z=(-0.005, 0.005))
    eset = em.equilibrium_set(truss, box, intervals=(4, 4, 4), checks=0)
    page = Opened(browser, em.explore(eset, path=tmp_path_factory.mktemp("volume") / "volume.html"))
    yield page
    page.context.close()
    assert not page.errors


def test_over_one_parameter_the_set_is_a_diagram(line):
    """F = k (1 − x_l/cos δ) sin δ at all that is picked; 1e-3: cells are chords of it there."""
    picked = line(PICKED)
    assert len(picked) > 10
    assert {index for _, _, index in picked} == {0, 1}
    for load, angle, _ in picked:
        assert (1.0 - FIXED / np.cos(angle)) * np.sin(angle) == pytest.approx(load, abs=1e-3)
    assert line("document.querySelectorAll('.view .axis').length") == 2


def test_keys_walk_to_the_fold_and_follow_the_snap(line):
    """The fold at F = (1 − x_l^⅔)^{3/2} is a vertex: 1e-6 is the precision of single floats."""
    line("explorer.goToPoint([0.0])")
    line("(() => { while (explorer.set.indexOf(explorer.spot)) explorer.next(); })()")
    line.page.focus(".view-box")
    start = line(STATE)["height"]
    key = "ArrowRight" if start > 0.0 else "ArrowLeft"
    for _ in range(15):
        line.page.keyboard.press(key)
    found = line(STATE)
    assert (found["end"], found["index"]) == ("fold", 0)
    assert abs(found["p"][0]) == pytest.approx((1.0 - FIXED ** (2.0 / 3.0)) ** 1.5, abs=1e-6)
    assert "releases about" in line.page.inner_text(".says")
    line.page.keyboard.press("s")
    landed = line(STATE)
    assert landed["index"] == 0
    assert landed["height"] * found["height"] < 0.0
    assert landed["p"] == pytest.approx(found["p"], abs=1e-9)


def test_over_three_parameters_keys_and_the_slider_move_the_slice(volume):
    """Page↑ and Page↓ walk in the third parameter; all that is drawn lies in the slice."""
    volume("explorer.goToPoint([0.001, 0.002, 0.0])")
    volume.page.focus(".view-box")
    for key, level in (("PageUp", 1e-4), ("PageUp", 2e-4), ("PageDown", 1e-4)):
        volume.page.keyboard.press(key)
        assert volume(STATE)["p"] == pytest.approx([0.001, 0.002, level], abs=1e-8)
        assert volume("explorer.view.level") == pytest.approx(level, abs=1e-8)
    volume.page.focus(".slice input")
    volume.page.keyboard.press("ArrowRight")
    level = volume("explorer.view.level")
    assert level != pytest.approx(1e-4, abs=1e-6)
    assert volume.page.inner_text(".slice output").replace("−", "-") == f"{level:.4g}"
    levels = volume(LEVELS)
    assert len(levels) > 10
    assert levels == pytest.approx([level] * len(levels), abs=1e-7)


def test_structures_in_space_turn_by_keys_and_by_dragging(volume):
    seen = [volume(SHAPE)]
    volume.page.focus("svg.shape")
    for key in ("ArrowLeft", "ArrowUp"):
        volume.page.keyboard.press(key)
        seen.append(volume(SHAPE))
    box = volume.page.locator("svg.shape").bounding_box()
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    volume.page.mouse.move(x, y)
    volume.page.mouse.down()
    volume.page.mouse.move(x + 40, y + 25)
    volume.page.mouse.up()
    seen.append(volume(SHAPE))
    assert len(set(seen)) == len(seen)


def test_reactions_of_supports_are_among_the_numbers(volume):
    """Together they bear the loads: Σ reaction(A, z) = −F_z, with the units of the structure."""
    names = volume("explorer.set.words.scalars.map((each) => each.name)")
    for axis, load in zip("xyz", volume(STATE)["p"], strict=True):
        own = [names.index(f"reaction(A{i},{axis})") for i in range(3)]
        total = volume("(own) => own.map((k) => explorer.set.scalar(k, explorer.spot))", own)
        assert sum(total) == pytest.approx(-load, abs=1e-4)
    assert "reaction(A0,x) (force)" in volume.page.inner_text(".numbers")


@pytest.mark.slow
def test_a_rod_in_space_is_a_ribbon_that_turns(opened, tmp_path):
    """Its widths are drawn; couples of both ends are among the numbers."""
    strip = em.SpatialRod(torsion=0.77, lateral=4.0)
    box, fixed = em.Box(q=(0.0, 2.0)), {"Theta": 0.9, "Delta": 0.1}
    within = [strip.max_curvature <= 9.0]
    eset = em.equilibrium_set(strip, box, fixed=fixed, within=within, intervals=(4,), checks=0)
    page = opened(em.explore(eset, path=tmp_path / "ribbon.html"))
    assert page("document.querySelectorAll('svg.shape .quad').length") > 50
    before = page(SHAPE)
    page.page.focus("svg.shape")
    page.page.keyboard.press("ArrowLeft")
    assert page(SHAPE) != before
    assert "end_couple(0, x)" in page.page.inner_text(".numbers")
