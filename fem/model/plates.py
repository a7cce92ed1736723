"""Stiffness and mass of plates with directions: layers, and whatever else is given by matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem.base.arrays import FloatArray
from fem.base.errors import ModelError, check_positive, is_finite

LEAST = -1e-9  # of the largest eigenvalue of a stiffness: rounding
NO_SHEAR = 1e3  # times 5/6 G t: the stiffness against shear of a plate without such deformation
Rows = Sequence[Sequence[float]]


@dataclass(frozen=True)
class PlateSection:
    """Stiffness and mass of a plate per unit of its area, in axes x, y of its own.

    Parameters
    ----------
    membrane, coupling, bending
        A in N/m, B in N and D in N m, (3, 3): forces A e + B k and moments B e + D k of the
        strains e (xx, yy, 2 xy) of the reference surface and the curvatures k, where the strain
        at the height z is e + z k.
    shear
        In N/m, (2, 2): transverse forces of the shear strains xz and yz.
    mass
        In kg/m².
    inertia
        In kg: of the turning of its fibres.

    Raises
    ------
    ModelError
        If a matrix has another shape, is not symmetric, or the energy may be negative.

    Examples
    --------
    >>> steel = Layer.isotropic(2.1e11, 0.3, 7800.0, thickness=0.01)
    >>> section = layered([steel])
    >>> round(section.bending[0][0]), round(section.mass, 9)
    (19231, 78.0)
    """

    membrane: Rows
    coupling: Rows
    bending: Rows
    shear: Rows
    mass: float
    inertia: float = 0.0

    def __post_init__(self) -> None:
        for name, size in (("membrane", 3), ("coupling", 3), ("bending", 3), ("shear", 2)):
            given = np.array(getattr(self, name), dtype=np.float64)
            scale = np.abs(given).max(initial=0.0)
            if given.shape != (size, size) or not np.isfinite(given).all():
                raise ModelError(f"plate section: {name} must be a matrix of {size} rows")
            if np.abs(given - given.T).max() > 1e-9 * scale:
                raise ModelError(f"plate section: {name} must be symmetric")
            object.__setattr__(self, name, tuple(map(tuple, given.tolist())))
        for name in ("mass", "inertia"):
            value = getattr(self, name)
            if not (is_finite(value) and value >= 0.0):
                raise ModelError(f"plate section: {name} must not be negative, not {value!r}")
            object.__setattr__(self, name, float(value))
        energies = {"membrane, coupling and bending": self.law, "shear": np.array(self.shear)}
        for name, matrix in energies.items():
            scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
            scale[scale == 0.0] = 1.0
            values = np.linalg.eigvalsh(matrix / np.outer(scale, scale))
            if values[0] < LEAST * values[-1]:
                raise ModelError(f"plate section: {name} make an energy that can be negative")

    @property
    def law(self) -> FloatArray:
        """The whole matrix (6, 6) for e and k."""
        A, B, D = (np.array(m) for m in (self.membrane, self.coupling, self.bending))
        return np.block([[A, B], [B, D]])

    def turned(self, angle: float) -> PlateSection:
        """The same in axes from which its own are turned by an angle in radians."""
        T, S = strain_turn(angle), shear_turn(angle)
        three = (T.T @ np.array(m) @ T for m in (self.membrane, self.coupling, self.bending))
        A, B, D = ((m + m.T) / 2.0 for m in three)
        shear = S.T @ np.array(self.shear) @ S
        return PlateSection(
            A.tolist(), B.tolist(), D.tolist(), shear.tolist(), self.mass, self.inertia
        )


def strain_turn(angle: float) -> FloatArray:
    """Strains (xx, yy, 2 xy) in axes that are turned by an angle from those in the old ones."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array(
        [[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]]
    )


def shear_turn(angle: float) -> FloatArray:
    """The same for transverse shear strains (xz, yz)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


@dataclass(frozen=True)
class Layer:
    """A layer of a plate.

    Parameters
    ----------
    law
        Stiffness (3, 3) in N/m² in plane stress along its own axes.
    shear
        Shear moduli (2, 2) in N/m² for xz and yz; zeros for no transverse shear deformation.
    density
        In kg/m³.
    thickness
        In m.
    angle
        In degrees, from the x axis of the plate to that of the layer.

    Examples
    --------
    >>> Layer.isotropic(2.0, 0.0, 1.0, 0.1).law[0][0]
    2.0
    """

    law: Rows
    shear: Rows
    density: float
    thickness: float
    angle: float = 0.0

    def __post_init__(self) -> None:
        check_positive("layer", thickness=self.thickness)

    @classmethod
    def isotropic(
        cls, youngs_modulus: float, poissons_ratio: float, density: float, thickness: float
    ) -> Layer:
        """A layer that is alike in all directions."""
        E, nu = youngs_modulus, poissons_ratio
        G, factor = E / (2.0 * (1.0 + nu)), E / (1.0 - nu**2)
        law = [[factor, nu * factor, 0.0], [nu * factor, factor, 0.0], [0.0, 0.0, G]]
        return cls(law, [[G, 0.0], [0.0, G]], density, thickness)


def layered(
    layers: Sequence[Layer], bottom: float | None = None, added_mass: float = 0.0
) -> PlateSection:
    """The section of layers one upon the other, by classical lamination theory.

    Parameters
    ----------
    layers
        From the bottom to the top, which is along the normal.
    bottom
        Height of the lowest face in m above the reference surface; by default half of the
        thickness below it.
    added_mass
        Further mass in kg/m².

    Notes
    -----
    The transverse shear stiffness is that of the shear stresses that are in equilibrium with
    cylindrical bending along x and along y [1]_; of one isotropic layer it is 5/6 G t.

    .. [1] E. Reissner, Note on the effect of transverse shear deformation in laminated
       anisotropic plates, Computer Methods in Applied Mechanics and Engineering 20 (1979) 203-209.

    Examples
    --------
    >>> one = Layer.isotropic(2.0, 0.0, 1.0, 0.1)
    >>> round(layered([one]).shear[0][0] / (5 / 6 * 0.1), 12)
    1.0
    """
    if not layers:
        raise ModelError("a plate needs a layer")
    total = sum(layer.thickness for layer in layers)
    lowest = -total / 2.0 if bottom is None else bottom
    faces = lowest + np.concatenate([[0.0], np.cumsum([layer.thickness for layer in layers])])
    laws = []
    for layer in layers:
        T = strain_turn(np.radians(layer.angle))
        laws.append(T.T @ np.array(layer.law) @ T)
    A, B, D = np.zeros((3, 3, 3))
    mass = inertia = 0.0
    middle = lowest + total / 2.0
    for law, layer, z0, z1 in zip(laws, layers, faces[:-1], faces[1:], strict=True):
        A += law * (z1 - z0)
        B += law * (z1**2 - z0**2) / 2.0
        D += law * (z1**3 - z0**3) / 3.0
        mass += layer.density * (z1 - z0)
        inertia += layer.density * ((z1 - middle) ** 3 - (z0 - middle) ** 3) / 3.0
    shear = _shear_stiffness(layers, laws, faces)
    A, B, D = ((m + m.T) / 2.0 for m in (A, B, D))
    return PlateSection(
        A.tolist(), B.tolist(), D.tolist(), shear.tolist(), mass + added_mass, inertia
    )


def _shear_stiffness(
    layers: Sequence[Layer], laws: Sequence[FloatArray], faces: FloatArray
) -> FloatArray:
    """Transverse shear stiffness (2, 2) from the energy of the shear stresses in equilibrium."""
    moduli = []
    for layer in layers:
        S = shear_turn(np.radians(layer.angle))
        moduli.append(S.T @ np.array(layer.shear) @ S)
    total = faces[-1] - faces[0]
    if all(np.abs(G).max() == 0.0 for G in moduli):
        largest = max(law[2, 2] for law in laws)
        return np.asarray(NO_SHEAR * 5.0 / 6.0 * largest * total * np.eye(2))
    for i, G in enumerate(moduli):
        if np.linalg.matrix_rank(G) < 2:  # a layer that shear does not deform
            moduli[i] = NO_SHEAR * laws[i][2, 2] * np.eye(2)
    stretch = [law[[0, 1], [0, 1]] for law in laws]  # along x and along y
    weights = [q * t.thickness for q, t in zip(stretch, layers, strict=True)]
    centre = sum(
        w * (z0 + z1) / 2.0 for w, z0, z1 in zip(weights, faces[:-1], faces[1:], strict=True)
    ) / sum(weights)
    rigid = sum(
        q * ((z1 - centre) ** 3 - (z0 - centre) ** 3) / 3.0
        for q, z0, z1 in zip(stretch, faces[:-1], faces[1:], strict=True)
    )
    places, shares = np.polynomial.legendre.leggauss(5)
    compliance, carried = np.zeros((2, 2)), np.zeros(2)
    for q, G, z0, z1 in zip(stretch, moduli, faces[:-1], faces[1:], strict=True):
        heights = z0 + (z1 - z0) * (places + 1.0) / 2.0
        flow = np.array(
            [carried + q * ((z - centre) ** 2 - (z0 - centre) ** 2) / 2.0 for z in heights]
        )
        flow = -flow / rigid
        inverse = np.linalg.inv(G)
        weight = shares * (z1 - z0) / 2.0
        compliance += np.einsum("g,gi,ij,gj->ij", weight, flow, inverse, flow)
        carried = carried + q * ((z1 - centre) ** 2 - (z0 - centre) ** 2) / 2.0
    return np.asarray(np.linalg.inv(compliance), dtype=np.float64)
