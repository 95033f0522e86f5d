"""All figures of studies fit at any size and with long names; studies draw nearly all kinds."""

import re

import pytest
from matplotlib.axes import Axes

from equimorph import plotting
from equimorph.plotting import style
from equimorph.study import run_study
from fits import SIZES, check_fit
from studies import EXAMPLES, empty_pages
from typecheck import unchecked

SPRING = """\
kind = "energy"
energy = "k*(1 - x_l/cos(delta))**2/2 + F*x_l*tan(delta)"
descriptors = { angle = "delta", height = "x_l*tan(delta)" }
unknowns = [{ name = "delta", natural = "acos(fmin(x_l, 1))", guesses = [-1.5, 1.5], unit = "rad" }]
mass = ["x_l**2"]
parameters = [
    { name = "x_l", unit = "m", role = "actuator", default = 0.8, lower = 0.0 },
    { name = "F", unit = "kN", role = "load" },
    { name = "k", unit = "kN/m", role = "fixed", default = 1.0, lower = 0.0 },
]
"""
TURNED = """
[structure.coordinates]
Theta = { theta_A = 1.0, theta_B = -1.0 }
Delta = { theta_A = 1.0, theta_B = 1.0 }
"""
SPRING_NAMES = {
    "x_l": "distance_between_the_supports_of_both_halves",
    "F": "force_that_pushes_the_middle_of_the_spring_down",
    "k": "stiffness_of_the_spring",
    "angle": "angle_of_the_left_half_against_the_base",
    "height": "height_of_the_middle_of_the_spring",
}
ROD_NAMES = {
    "Theta": "angle_by_which_both_ends_turn_inwards",
    "Delta": "angle_by_which_both_ends_turn_to_the_left",
}
COARSE = {"[93, 160]": "[6, 10]", "[46, 80]": "[6, 10]"}
STUDIES = {
    "tasks": ({'kind = "spring"\n': SPRING}, SPRING_NAMES, 40),
    "maps": (COARSE, ROD_NAMES, 2),
    "motion": ({}, ROD_NAMES, 5),
    "calibration": ({}, {}, 1),
}
"""Examples, what is replaced in them, longer names, and how many figures there are at least."""


@pytest.mark.slow
@pytest.mark.parametrize("name", STUDIES)
def test_figures_of_a_study_with_long_names_fit_at_all_sizes(name, tmp_path, monkeypatch):
    text = (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8")
    replaced, names, fewest = STUDIES[name]
    for old, new in replaced.items():
        assert old in text
        text = text.replace(old, new, 1)
    text += TURNED if "Theta" in names else ""
    for short, long in names.items():
        text = re.sub(rf"\b{short}\b", long, text)
    drawn = []

    def check(drawing, folder, figure_name):
        figure = drawing.get_figure(root=True) if isinstance(drawing, Axes) else drawing
        width, height = figure.get_size_inches()
        with style.house_style():
            for size in SIZES:
                figure.set_size_inches(size * width, size * height)
                check_fit(figure, figure_name)
        (folder / f"{figure_name}.png").touch()
        drawn.append(figure_name)

    monkeypatch.setattr(plotting, "save", check)
    for film in ("film", "replay_film"):
        monkeypatch.setattr(plotting, film, lambda _, path, **__: path.touch())
    empty_pages(monkeypatch)
    monkeypatch.setattr("equimorph.study.question.convert", lambda _, path: path.touch())
    monkeypatch.setattr("equimorph.study.html.pictures", lambda *_: "")
    study = tmp_path / f"{name}.toml"
    study.write_text(text)
    if name == "calibration":
        (tmp_path / "calibration.csv").write_bytes((EXAMPLES / "calibration.csv").read_bytes())
    with unchecked():
        run_study(study, tmp_path / "out")
    assert len(drawn) >= fewest
