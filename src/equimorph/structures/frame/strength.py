"""Strain and stress of the members of frames, in the plane and in space.

They are those of the axial force, of bending and of twist, see `fibres`, and of elastic strains
alone: arcs as drawn and actuated curvatures are free of stress.
"""

from abc import abstractmethod

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Values
from equimorph.errors import MissingError
from equimorph.model import Descriptor, remember_call
from equimorph.structures.any_network import AnyNetwork
from equimorph.structures.frame.any_model import AnyFrameModel
from equimorph.structures.rod.extrema import peaks, stations
from equimorph.structures.rod.fibres import Fibres, Stressed
from equimorph.structures.unit_system import UnitSystem

Nodal = Float[np.ndarray, "lanes elements order"]
NodalStrains = Float[np.ndarray, "lanes elements order 3"]


class StressedFrame(Stressed, AnyNetwork):
    """A frame with descriptors of strain, stress and safety of its members."""

    model: AnyFrameModel

    @abstractmethod
    def elastic(self, z: Lanes, p: Parameters) -> tuple[NodalStrains, Nodal]:
        """Elastic twist and curvatures about n and b at the nodes, and axial forces."""

    @property
    def own_system(self) -> UnitSystem:
        """Units of the frame."""
        return self.system

    @property
    def max_strain(self) -> Descriptor:
        """Largest elastic strain in the surfaces of all members, of axial forces and bending.

        Raises
        ------
        MissingError
            For a member without the size of its section.
        """
        return self.member_strain(None)

    @property
    def max_stress(self) -> Descriptor:
        """Largest stress in all members: of von Mises, of axial forces, bending and twist.

        Shear of forces across the members is left out, which is smaller by t/L.

        Raises
        ------
        MissingError
            As of `max_strain`.
        """
        return self.member_stress(None)

    @remember_call
    def member_strain(self, member: str | None) -> Descriptor:
        """`max_strain` in a member; None: in all."""
        return self._largest(member, "strain", "1", "max |ε|")

    @remember_call
    def member_stress(self, member: str | None) -> Descriptor:
        """`max_stress` in a member; None: in all."""
        return self._largest(member, "stress", self.stress_label, "max σ")

    @remember_call
    def _largest(self, member: str | None, what: str, unit: str, symbol: str) -> Descriptor:
        """Largest value along some pieces of what their fibres bear."""
        network, mesh = self.model.network, self.model.mesh
        every = range(len(network.ends))
        pieces = every if member is None else [at for at, _ in network.pieces_of(member)]
        parts = [(at, self._fibres(at)) for at in pieces]
        at = stations(mesh.breaks)
        matrix = mesh.interpolation(at)[:, : mesh.elements * mesh.degree + 1]

        def value(z: Lanes, p: Parameters) -> Values:
            bends, force = self.elastic(z, p)
            whole = np.concatenate(
                [bends / self.model.length, self.model.force * force[..., None]], 3
            )
            whole = whole.reshape(len(z), len(every), mesh.elements, -1, 4)
            inner = whole[:, :, :, :-1].reshape(len(z), len(every), -1, 4)
            along = matrix @ np.concatenate([inner, whole[:, :, -1, -1:]], axis=2)
            found = [
                peaks(getattr(fibres, what)(along[:, k, :, :3], along[:, k, :, 3]), at)[0].max(
                    axis=1
                )
                for k, fibres in parts
            ]
            return np.asarray(np.max(found, axis=0))

        name = f"max_{what}" if member is None else f"max_{what}({member})"
        shown = symbol if member is None else name
        return Descriptor(name, unit, value, shown, self.signature)

    def _fibres(self, piece: int) -> Fibres:
        network = self.model.network
        found = network.made[network.member_of(piece)].fibres
        if found is None:
            raise MissingError(
                "`max_strain` must be that of members with a section, like "
                "Member(..., section=Strip(...)), Round or Tube; got member "
                f"{network.name_of_member(piece)} without the size of its section."
            )
        return found
