"""Modes of two scenes side by side: of another mesh, or of another number of modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

import cms
from nldyn.base.arrays import Real
from nldyn.base.errors import SceneError
from nldyn.report.modes import mode_table
from nldyn.scene.build import Structure
from nldyn.scene.schema.scene import Scene

NEIGHBOURS = 12
ONE_FREQUENCY = 1e-3  # relative; on meshes without symmetry double modes lie apart
FARTHEST = 0.05  # of the size of the structure


@dataclass(frozen=True, eq=False)
class Comparison:
    """How much alike the modes of two models are.

    Parameters
    ----------
    mac : (k, l) array
        Modal assurance criterion of each mode of the one with each of the other, from 0 to 1.
    frequencies_hz, other_hz : (k,), (l,) array
        Their frequencies in Hz.
    scene, structure
        The other scene, and what it is made of.
    signs : (k,) array
        -1 where a mode and its partner are opposite, else 1.
    turn : (l, l) array
        Combines those of the other's modes that have one frequency, see `turned_alike`.
    """

    mac: Real
    frequencies_hz: Real
    other_hz: Real
    scene: Scene
    structure: Structure
    signs: Real
    turn: Real

    def __repr__(self) -> str:
        """One line: how many modes, and how alike the worst pair is."""
        k, l = self.mac.shape  # noqa: E741
        return (
            f"<Comparison: {k} with {l} modes, partners alike by {self.mac.max(axis=1).min():.3g}>"
        )

    @property
    def partners(self) -> list[int]:
        """Index of the other's mode that is most like each mode."""
        return [int(index) for index in self.mac.argmax(axis=1)]

    def columns(self) -> list[str]:
        """Names of the columns of the table."""
        named = [f"mac_with_{number + 1}" for number in range(len(self.other_hz))]
        return ["mode", "frequency_hz", "partner", "partner_hz", *named]

    def rows(self) -> list[list[float]]:
        """One for each mode; modes and partners are counted from 1."""
        return [
            [
                number + 1,
                float(self.frequencies_hz[number]),
                partner + 1,
                float(self.other_hz[partner]),
                *self.mac[number].tolist(),
            ]
            for number, partner in enumerate(self.partners)
        ]

    def report(self, modes: tuple[int, ...] = ()) -> str:
        """The table as text, of the modes asked for (from 1) or of all."""
        lines = [
            f"against {self.scene.file}:",
            " mode   frequency (Hz)   most like   at (Hz)   MAC",
        ]
        for number, hz, partner, other, *values in self.rows():
            if not modes or number in modes:
                value = max(values)
                lines.append(
                    f"{number:>5.0f}{hz:>17.6g}{partner:>12.0f}{other:>10.6g}{value:>8.4f}"
                )
        return "\n".join(lines)


def compare_modes(
    scene: Scene, structure: Structure, other: Scene, other_structure: Structure
) -> Comparison:
    """Compare the modes of two scenes that have meshes of one structure.

    The displacements of the finer mesh are carried to the nodes of the coarser one, by planes that
    are fitted to those of its nearest nodes; at nodes that both have they are taken as they are.
    The modal assurance criterion is over the translations of these nodes, each with the same
    weight, as if they had been measured there. Modes of one frequency, as rigid-body modes are, are
    known but for how they are combined: the other's are combined so as to be like these.

    Parameters
    ----------
    scene, other : Scene
        Two scenes with a mesh.
    structure, other_structure : Structure
        What `build_structure` gave for them.

    Returns
    -------
    Comparison

    Raises
    ------
    SceneError
        If one has no mesh, or a node lies farther from the other mesh than 5 % of the structure.
    """
    scenes = (scene, structure), (other, other_structure)
    mine, theirs = (moved_nodes(*given) for given in scenes)
    if len(mine[0]) <= len(theirs[0]):
        onto, shapes, others = mine[0], mine[1], carried(*theirs, mine[0], scene, other)
    else:
        onto, shapes, others = theirs[0], carried(*mine, theirs[0], other, scene), theirs[1]
    flat = [values.reshape(3 * len(onto), -1) for values in (shapes, others)]
    first, second = (mode_table(*given).frequencies_hz for given in scenes)
    turn = turned_alike(flat[0], flat[1], second)
    flat[1] = flat[1] @ turn
    values = cms.mac(*flat)
    cross = (flat[0].T @ flat[1])[np.arange(len(values)), values.argmax(axis=1)]
    signs = np.where(cross < 0.0, -1.0, 1.0)
    return Comparison(values, first, second, other, other_structure, signs, turn)


def turned_alike(shapes: Real, others: Real, hz: Real) -> Real:
    """A matrix (l, l) by which those of the other shapes (n, l) that have one frequency, within
    0.1 %, are combined so as to be most like some of the shapes (n, k).

    Examples
    --------
    >>> import numpy as np
    >>> tilted = np.array([[0.6, -0.8], [0.8, 0.6]])
    >>> np.allclose(tilted @ turned_alike(np.eye(2), tilted, np.zeros(2)), np.eye(2))
    True
    """
    turn = np.eye(len(hz))
    first = 0
    while first < len(hz):
        last = first + int(np.searchsorted(hz[first:], (1.0 + ONE_FREQUENCY) * hz[first], "right"))
        if last - first > 1:
            group = slice(first, last)
            combined = np.linalg.lstsq(others[:, group], shapes)[0]
            left = np.linalg.norm(shapes - others[:, group] @ combined, axis=0)
            alike = np.sort(np.argsort(left / np.linalg.norm(shapes, axis=0))[: last - first])
            basis = np.linalg.svd(combined[:, alike])[0]
            turn[group, group] = np.column_stack([combined[:, alike], basis[:, alike.size :]])
        first = last
    return turn


def moved_nodes(scene: Scene, structure: Structure) -> tuple[Real, Real]:
    """Places (n, 3) of all nodes, and their translations (n, 3, k) in the modes."""
    component: Any = structure.component
    if scene.components:
        raise SceneError(f"{scene.file}: has several components, whose modes cannot be compared")
    if scene.mesh is None or structure.reduced is None or isinstance(component, cms.Matrices):
        raise SceneError(f"{scene.file}: has no mesh, so that its modes cannot be compared")
    points = np.asarray(component.model.mesh.points)
    shapes = [np.asarray(component.shape(mode)) for mode in structure.reduced.basis.T]
    moved = np.stack(shapes, axis=2)[:, :3]
    if moved.shape[1] == 3 and shapes[0].shape[1] == 3:
        moved[:, 2] = 0.0  # of a frame in the plane this is the rotation
    return points, moved


def carried(points: Real, shapes: Real, onto: Real, scene: Scene, other: Scene) -> Real:
    """Shapes (n, 3, k) at points, carried to other places (m, 3): moving least squares."""
    tree: Any = cKDTree(points)  # whose types depend on k
    near, index = tree.query(onto, k=min(NEIGHBOURS, len(points)))
    size = float(np.linalg.norm(np.ptp(onto, axis=0)))
    worst = int(near[:, 0].argmax())
    if near[worst, 0] > FARTHEST * size:
        place = ", ".join(f"{value:.6g}" for value in onto[worst])
        raise SceneError(
            f"{other.file}: is no mesh of the structure in {scene.file}, whose node at ({place}) m "
            f"is {near[worst, 0]:.3g} m from the nearest of its nodes"
        )
    reach = near[:, -1:]
    offsets = (points[index] - onto[:, None]) / reach[..., None]
    planes = np.concatenate([np.ones((*index.shape, 1)), offsets], axis=2)
    weights = 1.0 / np.maximum(near / reach, 1e-9) ** 2
    fits = np.linalg.pinv(weights[..., None] * planes, rcond=1e-12)[:, 0] * weights
    found: Real = np.einsum("mj,mjck->mck", fits, shapes[index])
    same = near[:, 0] < 1e-9 * size
    found[same] = shapes[index[same, 0]]
    return found
