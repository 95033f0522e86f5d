"""Charts and atlases as files of their own, beside that of the set."""

from pathlib import Path

import h5py

from equimorph.charts import Atlas, Chart
from equimorph.storage import chart_group
from equimorph.storage.hdf import get_json, opened, put_json, write
from equimorph.structures import from_identity

FORMAT = "equimorph chart"
VERSION = 1
STRUCTURE, CHART = "structure", "chart"


def save_chart(path: str | Path, chart: Chart | Atlas) -> Path:
    """Write a chart or an atlas, with the set that it parameterises, barriers and cuts.

    Parameters
    ----------
    path
        Name of the file.
    chart
        A projection, descriptor chart, reduction or atlas.

    Raises
    ------
    InputError
        If `path` cannot be written, the structure has a callable, the reduction was by a function
        or nearest to a state, or the chart is one of an atlas.
    """

    def fill(file: h5py.File) -> None:
        put_json(file, STRUCTURE, chart.eset.structure.identity())
        chart_group.write(file.create_group(CHART), chart)

    return write(Path(path), FORMAT, VERSION, fill)


def load_chart(path: str | Path) -> Chart | Atlas:
    """Read what `save_chart` wrote.

    Raises
    ------
    InputError
        If the file is missing, no chart, newer than this release, truncated or damaged.
    """
    with opened(Path(path), FORMAT, VERSION) as file:
        return chart_group.read(file[CHART], from_identity(get_json(file, STRUCTURE)))
