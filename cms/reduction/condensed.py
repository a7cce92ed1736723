"""A component without its massless directions, which follow the others statically."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import aslinearoperator

from cms.base.arrays import FloatArray
from cms.component.component import NaturalForm, Pencil, times
from cms.component.massless import statically_split
from cms.reduction.model import ReducedModel
from cms.solvers.eigen import fastest_square, shift_over_rounding

NEGLIGIBLE = 1e-10  # of an interface's flexibility


@dataclass(frozen=True, eq=False)
class Condensed:
    """A component in coordinates that all have mass.

    Attributes
    ----------
    whole : Pencil
        The component as given.
    pencil : Pencil
        K and M in n coordinates, ``W^T K W`` and ``W^T M W``.
    shapes : (N, n) array
        ``u = W q + V V^T B f`` under interface forces f.
    massless : (N, z) array
        V, whose directions have no mass: ``V^T K V = I`` and ``V^T K W = 0``.
    """

    whole: Pencil
    pencil: Pencil
    shapes: FloatArray
    massless: FloatArray

    def expanded(self, model: ReducedModel) -> ReducedModel:
        """A model of the pencil as one of the whole, with the massless flexibility V gives."""
        direct = self.massless.T @ self.whole.loads
        squares = (2.0 * np.pi * model.frequencies_hz) ** 2
        rows = np.array([model.participation[name] for name in self.whole.names])
        elastic = squares > 0.0
        modal = np.sum(rows[:, elastic] ** 2 / squares[elastic], axis=1)
        direct = np.where(np.sum(direct**2, axis=0) <= NEGLIGIBLE * modal, 0.0, direct)
        whole = replace(model, basis=self.shapes @ model.basis)
        if not np.any(direct):
            return whole
        return replace(
            whole, residual_flexibility=direct.T @ direct, residual_shapes=self.massless @ direct
        )


def condensed(pencil: Pencil) -> Condensed | None:
    """The component without its massless directions; None where there are none.

    Where all of the mass is in some directions, ``K u - w^2 M u = B f`` in the others is
    ``Z^T K u = Z^T B f``, so that they can be eliminated without an error.
    """
    if not pencil.massless.shape[1]:
        return None
    shift = shift_over_rounding(pencil, fastest_square(pencil))
    moved = sparse.csc_array(pencil.stiffness + shift * pencil.mass)
    V, W = statically_split(moved, pencil.massless)
    natural = pencil.natural
    if natural is not None:
        natural = NaturalForm(natural.deformations @ aslinearoperator(W), natural.stiffness)
    K, M = pencil.energies(W), W.T @ times(pencil.mass, W)
    return Condensed(
        pencil,
        Pencil(
            sparse.csc_array(K),
            sparse.csc_array((M + M.T) / 2),
            pencil.names,
            W.T @ pencil.loads,
            natural,
            pencil.rounding,
            origin=(pencil, W),
        ),
        W,
        V,
    )
