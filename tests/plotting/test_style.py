"""The looks of the house: colours, and figures that leave no trace in matplotlib's state."""

import pickle
from io import BytesIO

import matplotlib as mpl
import numpy as np
import pytest
from IPython.core.formatters import PNGFormatter
from matplotlib.colors import to_rgb
from PIL import Image

from equimorph.plotting import style

ROOM = (0.4, 0.3, 0.1, 0.1)


def lightness(colour):
    """CIE L* of a colour: what remains of it in greyscale (IEC 61966-2-1, CIE 15)."""
    linear = np.array([c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour])
    y = float(linear @ [0.2126, 0.7152, 0.0722])
    return 116 * (y ** (1 / 3) if y > 0.008856 else 7.787 * y + 16 / 116) - 16


def test_importing_and_drawing_leave_the_global_settings_alone():
    before = dict(mpl.rcParams)
    with style.house_style():
        assert mpl.rcParams["font.size"] == 7
    assert dict(mpl.rcParams) == before


def test_colours_of_the_indices_differ_in_greyscale():
    """Ten units of L* are about two steps of a printer's grey wedge."""
    steps = np.diff([lightness(to_rgb(style.index_colour(k))) for k in range(4)])
    assert (steps > 7).all()


def test_shades_of_counts_grow_darker_step_by_step():
    shades = [lightness(shade[:3]) for shade in style.count_shades(6)]
    assert (np.diff(shades) < -3).all()
    assert shades[0] == pytest.approx(100.0, abs=0.1)


def test_progress_runs_from_dark_to_light_evenly():
    values = [lightness(colour[:3]) for colour in style.progress_map()(np.linspace(0, 1, 20))]
    steps = np.diff(values)
    assert (steps > 0).all()
    assert steps.max() < 2.5 * steps.mean()


@pytest.mark.parametrize(
    ("index", "label"), [(0, "stable"), (2, "index 2"), (3, "index ≥ 3"), (5, "index ≥ 3")]
)
def test_indices_are_named(index, label):
    assert style.index_label(index) == label


def test_what_is_drawn_shows_itself_at_the_prompt_of_a_notebook():
    """Figures, and all axes on them, as IPython looks for pictures; no backend has to be chosen."""
    axes = style.new_axes(style.SINGLE_COLUMN, 2.0, ROOM)
    formatter = PNGFormatter()
    shown = formatter(axes), formatter(axes.get_figure())
    assert shown[0] == shown[1]
    with Image.open(BytesIO(shown[0])) as image:
        assert image.size == (int(89 / 25.4 * style.SCREEN), 2 * style.SCREEN)
    again = pickle.loads(pickle.dumps(axes.get_figure()))
    assert formatter(again.axes[0]) == shown[0]


def test_saved_figure_has_column_width_at_two_hundred_dots_per_inch(tmp_path, monkeypatch):
    monkeypatch.setattr(style, "RESOLUTION", 200)
    axes = style.new_axes(style.SINGLE_COLUMN, 2.0, ROOM)
    png, svg = style.save(axes, tmp_path / "new", "figure")
    with Image.open(png) as image:
        assert image.size == (int(89 / 25.4 * 200), 400)
    assert svg.read_text(encoding="utf-8").lstrip().startswith("<?xml")


def test_the_same_drawing_gives_the_same_file(tmp_path):
    for name in ("first", "second"):
        axes = style.new_axes(style.SINGLE_COLUMN, 1.0, ROOM)
        axes.plot([0, 1], [0, 1])
        style.save(axes, tmp_path, name)
    for extension in ("png", "svg"):
        first, second = (tmp_path / f"{name}.{extension}" for name in ("first", "second"))
        assert first.read_bytes() == second.read_bytes()


def test_the_largest_count_has_the_same_shade_whatever_it_is():
    assert style.count_shades(1)[-1] == style.count_shades(6)[-1]
    assert style.count_shades(0) == style.count_shades(3)[:1]


def test_room_below_leaves_the_axes_their_size_and_distance_from_the_top():
    axes = style.new_axes(3.0, 2.0, ROOM)
    figure = axes.get_figure(root=True)

    def inches() -> np.ndarray:
        return np.array(axes.get_position().bounds) * np.tile(figure.get_size_inches(), 2)

    before = inches()
    style.grow_below(axes, 0.5)
    assert figure.get_size_inches() == pytest.approx([3.0, 2.5])
    np.testing.assert_allclose(inches(), np.add(before, [0.0, 0.5, 0.0, 0.0]), rtol=1e-12)
