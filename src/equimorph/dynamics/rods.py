"""Planar rods as linkages: joints that bend as the rod does between the middles of two links."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from equimorph.arrays import Float
from equimorph.dynamics.linkage import Bends, Linkage, Supports
from equimorph.dynamics.mechanism import Vector
from equimorph.dynamics.plant import PlanarChained
from equimorph.errors import MissingError
from equimorph.structures import (
    Couple,
    Curvature,
    LineLoad,
    PointForce,
    Pressure,
    Rod,
    SpatialRod,
    State,
    States,
    Tendon,
)
from equimorph.structures.rod.any_description import Construction, construction
from equimorph.structures.rod.ends import FREE, HELD, Holding, support_axes
from equimorph.structures.rod.model import Build
from equimorph.structures.rod.profiles import LoadShape
from equimorph.structures.rod.terms import Term
from equimorph.structures.rod.units import FOUR_PI_SQUARED
from equimorph.structures.spatial.model import direction_in_space

_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(6)

Function = Callable[[Float[np.ndarray, " points"]], Float[np.ndarray, " points"]]


def integrals(
    function: Function, edges: Float[np.ndarray, " edges"], breaks: Float[np.ndarray, " breaks"]
) -> Float[np.ndarray, " cells"]:
    """Integrals between successive edges, split where the function is not smooth."""
    inner = breaks[(breaks > edges[0]) & (breaks < edges[-1])]
    all_edges = np.unique(np.concatenate([edges, inner]))
    half = 0.5 * np.diff(all_edges)[:, None]
    points = all_edges[:-1, None] + half * (_GAUSS + 1.0)
    pieces = (half * _WEIGHTS * function(points.ravel()).reshape(points.shape)).sum(axis=1)
    cell = np.searchsorted(edges, 0.5 * (all_edges[1:] + all_edges[:-1]), side="right") - 1
    return np.bincount(cell, pieces, len(edges) - 1)


def between(s: np.ndarray, start: float, stop: float) -> np.ndarray:
    """1 on a stretch of the rod, 0 elsewhere."""
    return np.asarray(((s > start) & (s < stop)).astype(float))


def thrust(term: Tendon, axial: LoadShape) -> Function:
    """Strain by which a cable with the tension 1 shortens the rod."""
    return lambda s: between(s, term.start, term.stop) / axial.density(s)


def joint_forces(
    made: Construction[Any],
    nodes: Float[np.ndarray, " joints"],
    breaks: Float[np.ndarray, " breaks"],
) -> Float[np.ndarray, "joints 3 settings"]:
    """Dead forces on the joints, as tables of the settings."""
    links = len(nodes) - 1
    out = np.zeros((links + 1, 3, made.table.shape[1]))
    for name, terms in made.build.terms.items():
        for term in terms:
            if isinstance(term, LineLoad):
                weights = _hats(term.density().density, nodes, breaks)
            elif isinstance(term, PointForce):
                weights = shares(term.s * links, links + 1)
            else:
                continue
            out += np.einsum(
                "j,x,k->jxk", weights, direction_in_space(term.direction), made.row(name)
            )
    return out


def _hats(
    density: Function, nodes: Float[np.ndarray, " joints"], breaks: Float[np.ndarray, " breaks"]
) -> Float[np.ndarray, " joints"]:
    """Integrals of a density times the hat functions of the joints."""
    whole = integrals(density, nodes, breaks)
    moment = integrals(lambda s: s * density(s), nodes, breaks)
    right = (moment - nodes[:-1] * whole) * (len(nodes) - 1)
    out = np.zeros(len(nodes))
    out[1:] += right
    out[:-1] += whole - right
    return out


def shares(place: float, count: int) -> Float[np.ndarray, " count"]:
    """Weights of linear interpolation at a place counted in points."""
    at = float(np.clip(place, 0.0, count - 1.0))
    left = min(int(at), count - 2)
    out = np.zeros(count)
    out[left], out[left + 1] = 1.0 - (at - left), at - left
    return out


def holding_stiffness(holding: Holding) -> float:
    """Stiffness of a support: ∞ where it holds, 0 where it is free."""
    return {HELD: np.inf, FREE: 0.0}[holding] if isinstance(holding, str) else float(holding)


def time_of(rod: Rod | SpatialRod) -> float:
    """T = √(m L/λ_cr) in the rod's unit of time.

    Raises `MissingError` for a rod with units and without a mass.
    """
    unit = rod.units.time()
    if unit is None:
        raise MissingError(f"`structure` must have a mass; the rod has none. {rod.massless}")
    return unit


def rod_linkage(rod: Rod, links: int) -> Linkage:
    """A rod of length 1 and mass 1 as one member of N links.

    Lengths by L, forces by 4π²B/L². Half a link with twice the stiffness at each clamp makes the
    chain accurate to second order.
    """
    made = construction(rod.description, len(rod.parameters))
    build, nodes = made.build, np.linspace(0.0, 1.0, links + 1)
    breaks = build.mesh.breaks
    cells = np.concatenate([[0.0], nodes[:-1] + 0.5 / links, [1.0]])
    bends, supports = _bends_and_supports(made, links, *stiffness_and_rest(made, cells))
    forces, couples, pressure = _loads(made, nodes, breaks)
    axial, strains = _stretch(made, nodes, breaks)
    count, size = made.table.shape[1], 6 + 2 * links
    all_couples = np.zeros((size, count))
    all_couples[6 : 6 + links] = couples
    return Linkage(
        supports,
        np.array([[0, 1]]),
        np.full((1, links), 1.0 / links),
        np.full((1, links), 1.0 / links),
        bends,
        axial[None],
        strains[None],
        forces[None],
        all_couples,
        np.zeros((2, 2, count)),
        pressure[None],
    )


def stiffness_and_rest(
    made: Construction[Build], cells: Float[np.ndarray, " edges"]
) -> tuple[Float[np.ndarray, " cells"], Float[np.ndarray, "cells settings"]]:
    """Moment per turn of the cells of a rod, in λ_cr L, and their turns without moment.

    The turns come from intrinsic curvature, and from what tendons bend.
    """
    build, breaks = made.build, made.build.mesh.breaks
    soft = integrals(lambda s: FOUR_PI_SQUARED / build.stiffness.density(s), cells, breaks)
    out = np.zeros((len(cells) - 1, made.table.shape[1]))
    out[:, -1] = integrals(build.curvature.density, cells, breaks)
    for name, terms in build.terms.items():
        for term in terms:
            out += np.outer(integrals(_turning(term, build), cells, breaks), made.row(name))
    return 1.0 / soft, out


def _turning(term: Term, build: Build) -> Function:
    """Turn per arclength that a term of amplitude 1 gives a rod without moment."""
    if isinstance(term, Curvature):
        pattern = term.profile().density
        return lambda s: between(s, term.start, term.stop) * pattern(s)
    if isinstance(term, Tendon):
        offset, stiff = term.profiles()[0].density, build.stiffness.density
        return lambda s: between(s, term.start, term.stop) * offset(s) * FOUR_PI_SQUARED / stiff(s)
    return lambda s: np.zeros(len(s))


def _bends_and_supports(
    made: Construction[Build],
    links: int,
    stiffness: Float[np.ndarray, " cells"],
    rest: Float[np.ndarray, "cells settings"],
) -> tuple[Bends, Supports]:
    first, last = made.build.ends
    angle = 6 + np.arange(links)
    plus = np.concatenate([angle, [5]])
    minus = np.concatenate([[4], angle])
    keep = np.ones(links + 1, bool)
    keep[0], keep[-1] = first.angle != FREE, last.angle != FREE
    count = made.table.shape[1]
    turns = np.zeros((2, count))
    for side, name in enumerate(("theta_A", "theta_B")):
        if (first, last)[side].angle != FREE:
            turns[side] = made.row(name)
    axes = support_axes((first, last))
    places = np.zeros((2, 2, count))
    for k, axis in enumerate(axes):
        if axis.opposed:
            places[1, k] = made.row(axis.name)
    supports = Supports(
        np.array([[axis.unit for axis in axes]] * 2),
        np.array(
            [
                [holding_stiffness(axis.first) for axis in axes],
                [holding_stiffness(axis.last) for axis in axes],
            ]
        ),
        places,
        np.array([holding_stiffness(first.angle), holding_stiffness(last.angle)]),
        turns,
        np.array([first.angle != FREE, last.angle != FREE]),
    )
    return Bends(plus[keep], minus[keep], stiffness[keep], rest[keep]), supports


def _loads(
    made: Construction[Build],
    nodes: Float[np.ndarray, " joints"],
    breaks: Float[np.ndarray, " breaks"],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Forces on the joints, couples on the links, and the pressure, as tables of the settings."""
    links, count = len(nodes) - 1, made.table.shape[1]
    couples, pressure = np.zeros((links, count)), np.zeros(count)
    for name, terms in made.build.terms.items():
        row = made.row(name)
        for term in terms:
            if isinstance(term, Couple):
                couples += np.outer(shares(term.s * links - 0.5, links), row)
            elif isinstance(term, Pressure):
                pressure += row
    return joint_forces(made, nodes, breaks)[:, :2], couples, pressure


def _stretch(
    made: Construction[Build],
    nodes: Float[np.ndarray, " joints"],
    breaks: Float[np.ndarray, " breaks"],
) -> tuple[np.ndarray, np.ndarray]:
    """Axial stiffness of the links, and their strains at rest under the thrust of tendons."""
    build, links = made.build, len(nodes) - 1
    strains = np.zeros((links, made.table.shape[1]))
    if build.axial is None:
        return np.full(links, np.inf), strains
    stiff = build.axial.density
    axial = 1.0 / (links * integrals(lambda s: 1.0 / stiff(s), nodes, breaks))
    for name, terms in build.terms.items():
        for term in terms:
            if isinstance(term, Tendon):
                shorter = links * build.length * integrals(thrust(term, build.axial), nodes, breaks)
                strains -= np.outer(shorter, made.row(name))
    return axial, strains


class ChainedRod(PlanarChained):
    """A planar rod and its chain."""

    def __init__(self, rod: Rod, links: int) -> None:
        self.structure, self._mechanics, self.links = rod, rod.mechanics, links
        self.linkage = rod_linkage(rod, links)
        self.length, self.energy = rod.units.value("length"), rod.energy_scale
        self.time = time_of(rod)
        self._middles = (np.arange(links) + 0.5) / links
        self._joints = np.linspace(0.0, 1.0, links + 1)

    def fields(self, states: States, s: Float[np.ndarray, " points"]) -> np.ndarray:
        """Angle, its rate, and place at arclengths, in lengths of the rod."""
        return self._mechanics.fields(states.z, states.p, s)

    def angles(self, state: State) -> Float[np.ndarray, "members links"]:
        """Angles at the middles of the links."""
        return np.asarray(self.fields(state.batch, self._middles)[:, :, 0])

    def turns(self, state: State) -> Float[np.ndarray, " nodes"]:
        """Angles of the ends."""
        return np.asarray(self.fields(state.batch, np.array([0.0, 1.0]))[0, :, 0])

    def node_places(self, state: State) -> Float[np.ndarray, "nodes 2"]:
        """Places of the ends."""
        return np.asarray(self.fields(state.batch, np.array([0.0, 1.0]))[0, :, 2:])

    def places(self, states: States) -> Float[np.ndarray, "lanes members joints 2"]:
        """Places at the ends of links, in the structure's unit of length."""
        return np.asarray(self.fields(states, self._joints)[:, None, :, 2:] * self.length)

    def unknowns(self, v: Vector) -> Float[np.ndarray, " size"]:
        """Angles at the rod's nodes, by a spline through those of the links."""
        return self.unknowns_through(self._middles, v[self.linkage.angle_entries[0]])

    def unknowns_through(
        self, s: Float[np.ndarray, " points"], angles: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, " size"]:
        """Unknowns by a spline through angles at arclengths; multipliers 0."""
        mechanics, spline = self._mechanics, CubicSpline(s, angles)
        out = np.zeros(mechanics.size)
        out[: mechanics.unknowns] = spline(mechanics.mesh.nodes)[mechanics.unknown_nodes]
        return out
