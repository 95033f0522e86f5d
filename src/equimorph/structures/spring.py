"""The constrained spring: one degree of freedom, everything in closed form."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Float, Lanes, Parameters, Sides, Values
from equimorph.linalg import BorderedSolution, no_border, solve_bordered
from equimorph.linalg.intervals import Interval, cosine, inverse, join, sine, square
from equimorph.model import (
    Descriptor,
    Drawing,
    Forces,
    Parameter,
    Support,
    SupportKind,
    remember_call,
)
from equimorph.structures.contract import Structure, Symmetry
from equimorph.structures.equations import AnyBorder, Direction, Enclosed, Shift
from equimorph.structures.material_points import MaterialPoints
from equimorph.structures.states import State, natural_state

EFFORTS = {"natural length": "force", "k": "length", "force/length": "length²"}
"""Units of efforts by those of their parameters."""


@check_arguments
class Spring(Structure):
    """Spring of natural length 1 from A = (x_l, 0) to B on the line x = 0, force F on B.

    Energy ``E = ½ k (1 − x_l/cos δ)² + F x_l tan δ`` with the angle δ as unknown; equilibrium
    ``F = k (1 − x_l/cos δ) sin δ``; stable where x_l > cos³ δ. The residual carries the factor
    x_l/cos²δ of ∂E/∂δ.

    Parameters
    ----------
    stiffness
        Default of the parameter k, force per natural length; positive.
    mass
        Mass at B, in units of force·time²/natural length.

    References
    ----------
    [Feher2025]_, section 2.3.
    """

    kind: ClassVar[str] = "spring"
    unknowns = 1
    constraints = 0
    length_unit = "natural length"

    def __init__(self, stiffness: float = 1.0, mass: float = 1.0) -> None:
        self._mass = mass
        self.mass = np.ones(1)
        self.parameters = (
            Parameter("x_l", "natural length", 1.0, "actuator", 1.0, 0.0),
            Parameter("F", "k", 1.0, "load", 0.0),
            Parameter("k", "force/length", 1.0, "fixed", None, 0.0),
        )
        stiffness = self.parameters[2].check(stiffness)
        self.parameters = (
            *self.parameters[:2],
            Parameter("k", "force/length", 1.0, "fixed", stiffness, 0.0),
        )

    def identity(self) -> dict[str, Any]:
        """Kind, stiffness, and a mass that is not 1."""
        heavy = {} if self._mass == 1.0 else {"mass": self._mass}
        return {"kind": self.kind, "stiffness": self.parameters[2].default, **heavy}

    def plain_energy(self) -> dict[str, Any]:
        """The kind says it all."""
        return {"kind": "spring"}

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes 1 1"]:
        """m (x_l/cos²δ)²: the mass moves along y = x_l tan δ."""
        delta, x, _, _ = self._split(z, p)
        return np.asarray(self._mass * (x / np.cos(delta) ** 2) ** 2)[:, None, None]

    @property
    def material(self) -> MaterialPoints:
        """B, at (0, x_l tan δ)."""

        def places(z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes 1 1"]:
            return np.asarray(p[:, :1] * np.tan(z))[:, None]

        return MaterialPoints(self, places, np.array([self._mass]))

    def _split(self, z: Lanes, p: Parameters) -> tuple[Values, Values, Values, Values]:
        return z[:, 0], p[:, 0], p[:, 1], p[:, 2]

    def energy(self, z: Lanes, p: Parameters) -> Values:
        """½ k (1 − x_l/cos δ)² + F x_l tan δ."""
        delta, x, force, k = self._split(z, p)
        return np.asarray(0.5 * k * (1 - x / np.cos(delta)) ** 2 + force * x * np.tan(delta))

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """∂E/∂δ."""
        delta, x, force, k = self._split(z, p)
        balance = force - k * (1 - x / np.cos(delta)) * np.sin(delta)
        return np.asarray(balance * x / np.cos(delta) ** 2)[:, None]

    def _hessian(self, z: Lanes, p: Parameters) -> Values:
        delta, x, force, k = self._split(z, p)
        sine, cosine = np.sin(delta), np.cos(delta)
        balance = force - k * (1 - x / cosine) * sine
        slope = k * (x / cosine**2 - cosine)  # ∂balance/∂δ
        return np.asarray(x * (slope / cosine**2 + 2 * balance * sine / cosine**3))

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""
        return self._residual_derivative(z, p, (np.zeros_like(z), dp))

    def _residual_derivative(self, z: Lanes, p: Parameters, v: Direction) -> Lanes:
        """First derivative of F along a direction, by dual numbers of order one."""
        delta, x, force, k = self._split(z, p)
        dd, (dx, df, dk) = v[0][:, 0], v[1].T
        sine, cosine = np.sin(delta), np.cos(delta)
        balance = force - k * (1 - x / cosine) * sine
        factor = x / cosine**2
        change = df - dk * (1 - x / cosine) * sine + k * dx * np.tan(delta)
        change += k * (x / cosine**2 - cosine) * dd
        dfactor = dx / cosine**2 + 2 * x * sine / cosine**3 * dd
        return np.asarray(change * factor + balance * dfactor)[:, None]

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w] of F = balance · factor, by the product rule."""
        delta, x, force, k = self._split(z, p)
        sine, cosine, tangent = np.sin(delta), np.cos(delta), np.tan(delta)
        (vd, (vx, vf, vk)), (wd, (wx, wf, wk)) = (v[0][:, 0], v[1].T), (w[0][:, 0], w[1].T)
        secant2 = 1 / cosine**2
        stretch = 1 - x / cosine
        slope = x * secant2 - cosine

        def first(d: Values, dx: Values, df: Values, dk: Values) -> tuple[Values, Values]:
            balance = df - dk * stretch * sine + k * dx * tangent + k * slope * d
            return balance, dx * secant2 + 2 * x * tangent * secant2 * d

        b_v, f_v = first(vd, vx, vf, vk)
        b_w, f_w = first(wd, wx, wf, wk)
        b_vw = (vk * wx + wk * vx) * tangent + (vk * wd + wk * vd) * slope
        b_vw = b_vw + k * secant2 * (vx * wd + wx * vd)
        b_vw = b_vw + k * (2 * x * tangent * secant2 + sine) * vd * wd
        f_vw = 2 * tangent * secant2 * (vx * wd + wx * vd)
        f_vw = f_vw + x * (2 * secant2**2 + 4 * tangent**2 * secant2) * vd * wd
        balance = force - k * stretch * sine
        return np.asarray(b_vw * x * secant2 + b_v * f_w + b_w * f_v + balance * f_vw)[:, None]

    def enclosure(self, z: Interval, p: Interval) -> Enclosed:
        """Bounds over boxes of F = F x S² − k x S T + k x² S² T with S = sec δ, T = tan δ."""
        x, force, k = p[:, 0], p[:, 1], p[:, 2]
        cos = cosine(z[:, 0])
        s, t = inverse(cos), sine(z[:, 0]) / cos
        s2, t2 = square(s), square(t)
        pull = x * s * (x * s - 1.0) * t
        slope = x * s2 * (2.0 * force * t + k * (2.0 * x * t2 + x * s2)) - k * x * s * (t2 + s2)
        columns = [force * s2 + k * s * t * (2.0 * x * s - 1.0), x * s2, pull]
        rows = join([each[:, None, None] for each in columns], 2)
        return Enclosed((force * x * s2 + k * pull)[:, None], slope[:, None, None], rows)

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂E/∂(x_l, F, k)."""
        delta, x, force, k = self._split(z, p)
        stretch = 1 - x / np.cos(delta)
        by_x = -k * stretch / np.cos(delta) + force * np.tan(delta)
        return np.stack([by_x, x * np.tan(delta), 0.5 * stretch**2], axis=1)

    def solve(
        self, z: Lanes, p: Parameters, rhs: Sides, border: AnyBorder = None, shift: Shift = None
    ) -> BorderedSolution:
        """Solve with E'' − shift, bordered."""
        hessian = self._hessian(z, p) - (0.0 if shift is None else shift)
        columns, rows, corner = no_border(len(z), 1) if border is None else border
        return solve_bordered(hessian[:, None, None], columns, rows, corner, rhs)

    def natural(self, p: Parameters) -> tuple[Lanes, Flags]:
        """Unloaded: the stress-free spring δ = arccos x_l for x_l < 1, else δ = 0."""
        return np.arccos(np.minimum(p[:, :1], 1.0)), np.ones(len(p), bool)

    @check_arguments
    def natural_state(self, **values: float) -> State:
        """Unloaded state with B above A."""
        return natural_state(self, **values)

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Angles between −1.5 and 1.5."""
        return generator.uniform(-1.5, 1.5, size=(len(p), 1))

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """|δ| < π/2: beyond, B would lie on the other side of infinity."""
        return np.asarray(np.abs(z[:, 0]) < 0.5 * np.pi)

    def shape(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points 2"]:
        """Line from A = (x_l, 0) to B = (0, x_l tan δ); `s` runs from A to B."""
        at = np.linspace(0.0, 1.0, 2) if s is None else np.asarray(s, dtype=float)
        x = p[:, :1] * (1.0 - at)
        return np.stack([x, p[:, :1] * np.tan(z) * at], axis=2)

    def drawing(self, z: Lanes, p: Parameters) -> Drawing:
        """A slides on y = 0, B on x = 0, where the force acts downward."""
        ends = self.shape(z, p)
        supports = tuple(
            Support(SupportKind.ROLLER, ends[:, i], np.tile(along, (len(z), 1)))
            for i, along in enumerate(np.eye(2))
        )
        down = p[:, 1:2, None] * np.array([0.0, -1.0])
        return Drawing(supports, (Forces(ends[:, 1:], down),))

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Mirror: δ → −δ, F → −F."""
        signs = np.array([1.0, -1.0, 1.0])
        return (Symmetry("mirror", lambda z, p: (-z, p * signs), signs),)

    written: ClassVar[Mapping[str, str]] = {
        "angle": "angle",
        "height": "height",
        "energy": "total_energy",
    }
    energy_unit = "force·length"

    def effort_unit(self, parameter: Parameter) -> str:
        """Unit of the effort of a parameter: of a force for a length."""
        return EFFORTS.get(parameter.unit) or super().effort_unit(parameter)

    @cached_property
    @remember_call
    def angle(self) -> Descriptor:
        """δ in radians."""
        return Descriptor("angle", "rad", lambda z, p: z[:, 0].copy(), "δ", self.signature)

    @cached_property
    @remember_call
    def height(self) -> Descriptor:
        """Height of B in natural lengths."""

        def value(z: Lanes, p: Parameters) -> Values:
            return np.asarray(p[:, 0] * np.tan(z[:, 0]))

        return Descriptor("height", "natural length", value, "y_B", self.signature)

    @property
    def elevation(self) -> Descriptor:
        """δ."""
        return self.angle
