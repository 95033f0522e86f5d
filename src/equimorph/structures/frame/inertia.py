"""The mass of a frame."""

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Lanes, Parameters
from equimorph.model.units import STANDARD_GRAVITY
from equimorph.structures.frame.fields import FrameFields
from equimorph.structures.frame.model import FrameModel
from equimorph.structures.places_inertia import MaterialPoints


def member_masses(model: FrameModel) -> Float[np.ndarray, " members"] | None:
    """Masses of the members, in units of force·time²/length; None if one is not known."""
    system, found = model.system, []
    for member, length in zip(model.network.members, model.network.lengths, strict=True):
        what = f"mass of member {member.name}"
        if member.mass is not None:
            found.append(system.mass(member.mass, what))
        elif member.weight is not None and not system.plain:
            weight = float(member.weight) * length * system.si("force")
            found.append(system.mass(weight / STANDARD_GRAVITY, what))
        else:
            return None
    return np.array(found)


def frame_material(frame: FrameFields, masses: Float[np.ndarray, " members"]) -> MaterialPoints:
    """Members that are as heavy everywhere, in units of the frame's energy."""
    model = frame.model

    def places(z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes points 2"]:
        return frame.outline(z, p, model.mesh.nodes).reshape(len(z), -1, 2)

    heavy = masses * model.length**2 / frame.energy_scale
    return MaterialPoints(frame, places, np.outer(heavy, model.mesh.weights).ravel())
