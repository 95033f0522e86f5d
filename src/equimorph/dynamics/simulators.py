"""Which simulator covers which structure."""

from equimorph.dynamics.cosserat import CosseratModel, elastica_module
from equimorph.dynamics.direct import TrussModel
from equimorph.dynamics.frames import ChainedFrame
from equimorph.dynamics.linkage_model import LinkageModel
from equimorph.dynamics.model import Model
from equimorph.dynamics.own_equations import OwnModel
from equimorph.dynamics.plant import mujoco_module
from equimorph.dynamics.rods import ChainedRod
from equimorph.dynamics.spatial_rods import ChainedSpatialRod, check_isolated
from equimorph.errors import InputError
from equimorph.structures import Frame, Rod, SpatialRod, State, Truss


def model_of(start: State, simulator: str, links: int) -> Model:
    """The structure of a state as a simulator sees it.

    Refused if the simulator does not cover it, or is not installed; there is no silent fall-back.
    """
    structure = start.structure
    if simulator == "own":
        return OwnModel(structure, start)
    if simulator == "pyelastica":
        elastica_module()
        if isinstance(structure, Rod):
            return CosseratModel(structure, start, links)
    else:
        mujoco_module()
        if isinstance(structure, Rod):
            return LinkageModel(ChainedRod(structure, links))
        if isinstance(structure, SpatialRod):
            check_isolated(structure, start, simulator)
            return LinkageModel(ChainedSpatialRod(structure, links))
        if isinstance(structure, Frame):
            return LinkageModel(ChainedFrame(structure, links))
        if isinstance(structure, Truss):
            return TrussModel(structure, start)
    raise InputError(
        f"`simulator` must cover the structure; got {simulator!r} for a {structure.kind}. "
        'simulator="own" replays every structure by its own equations of motion.'
    )
