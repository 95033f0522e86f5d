"""Route certificates: what a proof says in numbers that anybody can check without this package.

See docs/decisions.md, "A certificate carries the energy, not F".
"""

import json
from pathlib import Path

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.errors import InputError
from equimorph.model import names_of
from equimorph.storage.files import write_text
from equimorph.tasks.verification.evidence import ProofStatus
from equimorph.tasks.verification.proof import Proof

FORMAT = "route certificate, version 2"
"""First entry of a certificate."""


@check_arguments
def write_certificate(proof: Proof, path: str | Path) -> Path:
    """Write what a proof says as JSON that others can check without this package.

    It holds the corners of the schedule with their states, the half widths of the tube around each
    segment, the margin, and the energy in plain numbers. ``checker/check_route.py`` differentiates
    that energy anew and checks the statement by interval arithmetic; it needs numpy only.

    Parameters
    ----------
    proof
        With the status "proved": that of `verify` with ``proof=True``.
    path
        Ending in ``.json``.

    Returns
    -------
    The file written.

    Raises
    ------
    InputError
        If nothing is proved, for a structure whose energy is not written in plain numbers (those
        of springs, trusses, planar rods and frames and formulas are), or for another ending.

    Examples
    --------
    ``em.storage.write_certificate(em.verify(route.schedule, proof=True).proof, "route.json")``
    """
    place, structure = Path(path), proof.states.structure
    if place.suffix != ".json":
        raise InputError(f"`path` must end in .json; got {place.name}.")
    if proof.status is not ProofStatus.PROVED or proof.tubes is None:
        raise InputError(f"`proof` must be proved; got one that is {proof.status}.")
    energy = structure.plain_energy()
    if energy is None:
        raise InputError(
            f"`proof` must be that of a structure whose energy is written in numbers (spring, "
            f"truss, planar rod or frame, usual formulas); got a {structure.kind}."
        )
    certificate = {
        "format": FORMAT,
        "parameters": list(names_of(structure.parameters)),
        "index": 0,
        "margin": proof.margin,
        "mass": [*structure.mass.tolist(), *np.zeros(structure.constraints).tolist()],
        "p": proof.states.p.tolist(),
        "z": proof.states.z.tolist(),
        "tubes": proof.tubes.tolist(),
        "structure": energy,
    }
    write_text(place, json.dumps(certificate) + "\n")
    return place
