"""Draw docs/space.png: limit loads of the arch in its plane, and as a round rod in space."""

from pathlib import Path

import matplotlib.pyplot as plt

from equimorph import Grid, Rod, limit_load_map, plotting, strongest

FOLDER = Path(__file__).parent
GRID = Grid(Theta=(0.3, 1.6, 40), Delta=(-1.2, 1.2, 40))
DOTS = 200  # per inch


def main(file: Path = FOLDER / "space.png", grid: Grid = GRID) -> Path:
    """Draw both maps, up to max |κ| = 10, side by side on one scale."""
    rod = Rod(torsion=1 / 1.3, lateral=1.0)
    curved = rod.max_curvature <= 10.0
    planar = limit_load_map(rod, grid, "q", within=[curved])
    spatial = limit_load_map(rod, grid, "q", within=[curved, rod.stable_in_space])
    with plotting.style.house_style():
        figure, axes = plt.subplots(1, 2, figsize=(7.6, 3.2))
        figure.subplots_adjust(left=0.07, right=0.93, bottom=0.27, top=0.92, wspace=0.5)
        for ax, found in zip(axes, (planar, spatial), strict=True):
            plotting.load_map(found, ax, highest=strongest(planar).best.value)
        axes[0].set_title("strip: in its plane")
        axes[1].set_title("round rod: in space")
    figure.savefig(file, dpi=DOTS)
    plt.close(figure)
    return file


if __name__ == "__main__":
    main()
