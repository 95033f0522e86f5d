"""Which simulator covers which structure."""

from equimorph.dynamics.frames import ChainedFrame
from equimorph.dynamics.linkage_model import LinkageModel
from equimorph.dynamics.model import Model
from equimorph.dynamics.rods import ChainedRod
from equimorph.errors import InputError
from equimorph.structures import Frame, Rod, Structure


def model_of(structure: Structure, simulator: str, links: int) -> Model:
    """A structure as a simulator sees it.

    Raises
    ------
    InputError
        If the simulator does not cover it; there is no silent fall-back.
    """
    if isinstance(structure, Rod):
        return LinkageModel(ChainedRod(structure, links))
    if isinstance(structure, Frame):
        return LinkageModel(ChainedFrame(structure, links))
    raise InputError(
        f"`simulator` must cover the structure; got {simulator!r} for a {structure.kind}. "
        'simulator="own" replays every structure by its own equations of motion.'
    )
