"""Load vectors of what acts on a whole component: weight, and motions of the base."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from fem.base.arrays import FloatArray
from fem.base.errors import ModelError
from fem.elements.scatter import SparseArray


class InertiaLoads:
    """What the dataclass of a component needs to be loaded by its own mass."""

    mass: SparseArray
    interfaces: Mapping[str, FloatArray]
    inertia: FloatArray
    rigid_mass: FloatArray
    load_vectors: tuple[str, ...]
    areas: Mapping[str, Any]

    def __repr__(self) -> str:
        """One line: how large and how heavy it is, and where it can be held or hit."""
        rows, names = self.mass.shape[0], ", ".join(f"'{name}'" for name in self.interfaces)
        return (
            f"<{type(self).__name__} of {rows} degrees of freedom, {self.rigid_mass[0, 0]:.4g} kg; "
            f"interfaces {names or 'none'}>"
        )

    def with_load(self, name: str, acceleration: Sequence[float]) -> Self:
        """The component with a load vector: its weight under an acceleration.

        It is an interface of this name that nothing can be joined to, so that a reduction keeps
        its static deflection exact.

        Parameters
        ----------
        name
            Of the load vector.
        acceleration
            Components (x, y, z) in m/s², z being 0 in the plane; a load is a factor of it.

        Raises
        ------
        ModelError
            If there is an interface of this name, or no mass is moved that way.
        """
        vector = inertia_load(self.inertia, self.interfaces, name, acceleration)
        return replace(  # type: ignore[type-var]  # of a dataclass
            self,
            interfaces={**self.interfaces, name: vector},
            load_vectors=(*self.load_vectors, name),
        )

    def with_interfaces(
        self, vectors: Mapping[str, FloatArray], areas: Mapping[str, Any] = MappingProxyType({})
    ) -> Self:
        """The component with further interfaces, such as those of `contact_points`.

        Parameters
        ----------
        vectors
            Load vectors (N,) of unit forces, by name.
        areas
            Which of them are points of areas of contact, as `cms.Area`; a reduction gives these
            few attachment modes.

        Raises
        ------
        ModelError
            If a name is in use, or a vector has another length.
        """
        for name, vector in vectors.items():
            if name in self.interfaces:
                raise ModelError(f"there is an interface named '{name}' already")
            if np.shape(vector) != (self.mass.shape[0],):
                raise ModelError(
                    f"interface '{name}' has shape {np.shape(vector)}, it must have "
                    f"({self.mass.shape[0]},)"
                )
        return replace(  # type: ignore[type-var]  # of a dataclass
            self,
            interfaces={**self.interfaces, **vectors},
            areas={**self.areas, **areas},
        )


def inertia_load(
    inertia: FloatArray, names: Container[str], name: str, acceleration: Sequence[float]
) -> FloatArray:
    """Load vector (N,) of an acceleration, by the ``inertia`` (N, 2 or 3) of a component.

    Raises
    ------
    ModelError
        If the name is among those in use, or no mass is moved that way.
    """
    if name in names:
        raise ModelError(f"there is an interface named '{name}' already")
    axes = inertia.shape[1]
    along = np.zeros(3)
    along[: len(acceleration)] = acceleration
    if np.any(along[axes:]):
        raise ModelError("a structure in the plane cannot be accelerated along z, out of its plane")
    vector = inertia @ along[:axes]
    if not np.any(vector):
        raise ModelError(f"nothing moves along the acceleration {along.tolist()}")
    vector.setflags(write=False)
    return np.asarray(vector)
