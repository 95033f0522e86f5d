"""Draw docs/surface.png, the picture on top of the README, from the results of `make run`."""

from pathlib import Path

from PIL import Image

from equimorph import plotting, storage

FOLDER = Path(__file__).parent
RESULTS = FOLDER.parent / "results" / "arch" / "results.h5"
DOTS = 270  # per inch: 1400 pixels wide


def main(results: Path = RESULTS, file: Path = FOLDER / "surface.png") -> Path:
    """Draw the surface with its first route; 255 colours keep the file small."""
    found = storage.read_results(results)
    eset = found.equilibrium_set
    route = next(iter(found.routes.values()))
    axes = plotting.surface(eset, eset.structure.height(0.5), route=route)
    axes.figure.savefig(file, dpi=DOTS)
    with Image.open(file) as picture:
        reduced = picture.convert("RGB").quantize(255, Image.Quantize.MEDIANCUT)
    reduced.save(file, optimize=True)
    return file


if __name__ == "__main__":
    main()
