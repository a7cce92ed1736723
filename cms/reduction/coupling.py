"""Several reduced components joined at their interfaces."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from cms.base.arrays import FloatArray
from cms.base.errors import ReductionError
from cms.reduction.model import ReducedModel, positive

Place = tuple[str, str]

DUAL = "dual-craig-bampton"
RIGID_JOINT = 1e-12
RIGID_RANK = 1e-9
RIGID_GAP = 1e-5  # frequency of a rigid-body mode that is rounding, beside the first elastic one
COUPLED_ERROR = 1e-8
TINY = 1e-300  # in place of a divisor that is zero
DEPENDENT = 1e-10  # least over largest singular value of conditions that depend on each other
ROUNDED = 1e-12  # of the parts' flexibility: what coupling leaves of it is rounding
OTHER = 1e-6  # part of a shape that the ones before it do not hold: it is another one


@dataclass(frozen=True)
class Joint:
    """A joint between two interfaces, or from an interface to the ground.

    Attributes
    ----------
    a : (str, str)
        Component and interface.
    b : (str, str), optional
        Component and interface that moves with it; the ground unless given.
    stiffness : float, optional
        Of a spring between them in N/m; unless given they move as one.
    damping : float
        Of a damper beside the spring in N s/m.

    Examples
    --------
    >>> Joint(("arm", "tip"), ("tool", "flange")).stiffness is None
    True
    """

    a: Place
    b: Place | None = None
    stiffness: float | None = None
    damping: float = 0.0


@dataclass(frozen=True, eq=False)
class Assembly:
    """Components side by side, before they are joined.

    Attributes
    ----------
    places : list of (str, str)
        All interfaces.
    omega : (n,) array
        Circular frequencies of all modal coordinates.
    rows : (m, n) array
        Participation of the coordinates at the interfaces.
    flexibility : (m, m) array
        Their massless flexibility.
    damping : (n, n) array
        Damping matrix.
    basis, shapes : (N, n), (N, m) arrays
        Shapes of the coordinates, and of unit forces through the massless flexibility.
    components : dict of str to (int, int)
        Rows of each component.
    load_vectors : tuple of str
        Names of those interfaces of the coupled model that are load vectors.
    left_out_hz : tuple of float
        Of all components, see `ReducedModel`.
    """

    places: list[Place]
    omega: FloatArray
    rows: FloatArray
    flexibility: FloatArray
    damping: FloatArray
    basis: FloatArray
    shapes: FloatArray
    components: Mapping[str, tuple[int, int]]
    load_vectors: tuple[str, ...] = ()
    left_out_hz: tuple[float, ...] = ()

    def joint_rows(self, joints: Sequence[Joint]) -> FloatArray:
        """Signed interface displacements that open each joint, (j, m)."""
        rows = np.zeros((len(joints), len(self.places)))
        for row, joint in zip(rows, joints, strict=True):
            row[self.places.index(joint.a)] += 1.0
            if joint.b is not None:
                row[self.places.index(joint.b)] -= 1.0
        return rows


def couple(components: Mapping[str, ReducedModel], joints: Sequence[Joint]) -> ReducedModel:
    r"""Join reduced components to one reduced model.

    Parameters
    ----------
    components : mapping of str to ReducedModel
        The components by name.
    joints : sequence of Joint
        What holds them together.

    Returns
    -------
    ReducedModel
        Its interfaces are named "component.interface", those at the joints, too. Its ``basis`` has
        the components' displacements below each other; ``expand(q, component)`` gives one.

    Raises
    ------
    ReductionError
        If a component or an interface is unknown, the same interfaces are joined twice, methods
        do not go together, or the model does not have the masses, the energy, or the rigid-body
        modes of its parts.

    Notes
    -----
    Interface displacements are linear in the modal coordinates whatever the method, so that the
    joints are linear conditions A q = 0; their null space is a Rayleigh-Ritz basis of the whole.
    With MacNeal's massless flexibility G the forces λ in the joints follow from
    :math:`A q + J G J^T \lambda = 0` [1]_ and become stiffnesses. Frequencies are singular values
    of the stacked rows of Ω and of these stiffnesses, which keeps the slow ones accurate.

    Components by "dual-craig-bampton" keep λ as unknowns [2]_: with residual shapes Ψ,
    :math:`u = \Phi\eta + \Psi\lambda`, and the interfaces fit only in a weak sense. Statics stay
    exact for loads at interfaces that are not joined. There is one negative eigenvalue for each
    joint. These spurious modes are far away in frequency and are kept as massless (negative)
    flexibility.

    References
    ----------
    .. [1] MacNeal, R.H. (1971), Computers & Structures 1(4), 581-601.
    .. [2] Rixen, D.J. (2004), Journal of Computational and Applied Mathematics 168, 383-391.

    Examples
    --------
    >>> import numpy as np, cms
    >>> half = cms.Matrices([[1.0, -1.0], [-1.0, 1.0]], np.eye(2),
    ...                     {"left": [1.0, 0.0], "right": [0.0, 1.0]})
    >>> model = cms.reduce(half, modes=2)
    >>> both = cms.couple({"a": model, "b": model}, [cms.Joint(("a", "right"), ("b", "left"))])
    >>> (2 * np.pi * both.frequencies_hz[1:]).round(6).tolist()     # masses 1, 2, 1
    [1.0, 1.414214]
    """
    check_components(components)
    check_joints(components, joints)
    dual = [model.method == DUAL for model in components.values()]
    shared = {f"{of}.{at}": told for of, m in components.items() for at, told in m.areas.items()}
    if all(dual) and joints:
        return replace(coupled_dually(components, joints), areas=shared)
    if any(dual) and joints:
        others = sorted({m.method for m in components.values() if m.method != DUAL})
        raise ReductionError(
            f"components by '{DUAL}' cannot be coupled with components by '{others[0]}'"
        )
    return replace(coupled_primally(side_by_side(components), joints), areas=shared)


def coupled_primally(assembly: Assembly, joints: Sequence[Joint]) -> ReducedModel:
    """Join by common displacements, or by forces through the massless flexibility."""
    springs = [joint for joint in joints if joint.stiffness != 0.0]
    J = assembly.joint_rows(springs)
    A = J @ assembly.rows
    series = [0.0 if j.stiffness is None else 1.0 / j.stiffness for j in springs]
    between = J @ assembly.flexibility @ J.T + np.diag(series)
    weights, directions = linalg.eigh(between) if springs else (np.zeros(0), np.zeros((0, 0)))
    soft = weights > RIGID_JOINT * joint_scale(A, assembly.omega, weights)
    compliant = (directions[:, soft] / np.sqrt(weights[soft])).T
    stiff_rows = compliant @ A
    free = null_space(directions[:, ~soft].T @ A, assembly.omega.size)
    stacked = np.vstack([assembly.omega[:, None] * free, stiff_rows @ free])
    _, omega, turn = linalg.svd(stacked, full_matrices=False)
    order = np.argsort(omega, kind="stable")
    vectors = free @ turn[order].T
    omega = omega[order]
    expected = rigid_motions(A, assembly.omega)
    check_coupled(omega, expected, vectors, directions[:, ~soft].T @ A, stacked @ turn[order].T)
    omega[:expected] = 0.0
    force = compliant.T @ compliant
    through = J @ assembly.flexibility
    rows = (assembly.rows - through.T @ force @ A) @ vectors
    shapes = assembly.shapes - assembly.shapes @ J.T @ force @ through
    basis = (assembly.basis - assembly.shapes @ J.T @ force @ A) @ vectors
    damping = vectors.T @ (assembly.damping + damper_matrix(assembly, joints)) @ vectors
    return model_of(
        assembly,
        omega,
        rows,
        basis,
        damping=damping,
        flexibility=assembly.flexibility - through.T @ force @ through,
        shapes=shapes,
        method="coupled",
    )


def rigid_motions(rows: FloatArray, omega: FloatArray) -> int:
    """How many motions of the components at 0 Hz (n,) open no joint, by its rows (j, n)."""
    rigid = rows[:, omega == 0.0]
    length = np.linalg.norm(rigid, axis=1)
    moved = length > RIGID_RANK * np.linalg.norm(rows, axis=1)
    if not rigid.shape[1] or not np.any(moved):
        return int(rigid.shape[1])
    scaled = rigid[moved] / length[moved, None]
    return int(rigid.shape[1] - np.linalg.matrix_rank(scaled, tol=RIGID_RANK))


def check_coupled(
    omega: FloatArray, rigid: int, vectors: FloatArray, closed: FloatArray, stretch: FloatArray
) -> None:
    """Compare a coupled model with its parts, and raise ReductionError where something is off.

    Parameters
    ----------
    omega : (r,) array
        Its circular frequencies, ascending.
    rigid : int
        Number of rigid-body modes that the parts leave it.
    vectors : (n, r) array
        Its modes in the coordinates of the parts, whose masses are 1.
    closed : (j, n) array
        Rows of the rigid joints.
    stretch : (k, r) array
        ``S V``, where ``S^T S`` is the stiffness of parts and springs.
    """
    if omega.size == 0:
        return
    if rigid > omega.size:
        raise ReductionError(f"{rigid} rigid-body modes are left of {omega.size} modes")
    elastic = omega[rigid] if rigid < omega.size else omega[-1]
    if rigid and omega[rigid - 1] > RIGID_GAP * elastic:
        hz = omega[rigid - 1] / (2 * np.pi)
        raise ReductionError(
            f"the parts and joints leave {rigid} rigid-body modes, but mode {rigid} of the coupled "
            f"model has {hz:.4g} Hz: the parts' rigid-body modes do not fit at the joints"
        )
    if rigid < omega.size and omega[rigid] <= 4 * np.finfo(float).eps * omega[-1]:
        raise ReductionError(
            f"mode {rigid + 1} of the coupled model has no stiffness beside its fastest one, "
            f"though the parts and joints leave {rigid} rigid-body modes: the stiffnesses differ "
            "too much"
        )
    mass = np.abs(vectors.T @ vectors - np.eye(omega.size)).max()
    energy = np.abs(stretch.T @ stretch - np.diag(omega**2)).max() / max(omega[-1] ** 2, TINY)
    size = np.linalg.norm(closed, axis=1)[:, None] * np.linalg.norm(vectors, axis=0)
    gap = np.max(np.abs(closed @ vectors) / np.where(size > 0.0, size, 1.0), initial=0.0)
    for what, error in (("mass", mass), ("energy", energy), ("displacement at a joint", gap)):
        if not error <= COUPLED_ERROR:
            raise ReductionError(
                f"the {what} of the coupled model differs from that of its parts by {error:.1e}"
            )


def coupled_dually(components: Mapping[str, ReducedModel], joints: Sequence[Joint]) -> ReducedModel:
    """Join by common interface forces: the dual Craig-Bampton method."""
    assembly = side_by_side(components)
    if any(joint.stiffness == 0.0 for joint in joints):
        raise ReductionError(f"a joint of components by '{DUAL}' needs a stiffness above zero")
    if np.any(assembly.damping) or any(joint.damping for joint in joints):
        raise ReductionError(f"components by '{DUAL}' are coupled without damping")
    J = assembly.joint_rows(joints)
    kept: list[int] = []
    attached: list[int] = []
    first = 0
    for model in components.values():
        kept += range(first, first + model.modes)
        attached += range(first + model.modes, first + model.size)
        first += model.size
    A, P = J @ assembly.rows[:, kept], assembly.rows[:, attached]
    squares = assembly.omega[attached] ** 2
    answer = (P.T / squares[:, None]) @ J.T if attached else np.zeros((0, len(joints)))
    rest = beside(answer, (P[unjoined(assembly, joints)] / squares).T, squares)
    k, g, j = len(kept), rest.shape[1], len(joints)
    series = np.diag([0.0 if x.stiffness is None else 1.0 / x.stiffness for x in joints])
    K, M = dual_matrices(assembly.omega[kept] ** 2, squares, rest, answer, A, series)
    turn = np.zeros((assembly.omega.size, k + g + j))
    turn[kept, :k] = np.eye(k)
    turn[attached, k : k + g] = rest
    turn[attached, k + g :] = answer
    try:
        values, vectors = linalg.eigh(K, M)
    except linalg.LinAlgError:
        raise ReductionError(
            "the residual flexibility at a joint has no part of its own, so that the components "
            "cannot be coupled dually; keep fewer modes"
        ) from None
    rigid = 64 * np.finfo(float).eps * np.abs(values).max()
    values = np.where(np.abs(values) <= rigid, 0.0, values)
    spurious = values < 0.0
    all_rows, all_shapes = assembly.rows @ turn @ vectors, assembly.basis @ turn @ vectors
    lost = all_rows[:, spurious] / values[spurious]
    return model_of(
        assembly,
        np.sqrt(values[~spurious]),
        all_rows[:, ~spurious],
        all_shapes[:, ~spurious],
        damping=np.zeros((np.count_nonzero(~spurious),) * 2),
        flexibility=lost @ all_rows[:, spurious].T,
        shapes=all_shapes[:, spurious] @ lost.T,
        method=DUAL,
    )


def dual_matrices(
    kept: FloatArray,
    squares: FloatArray,
    rest: FloatArray,
    answer: FloatArray,
    A: FloatArray,
    series: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """K and M for coordinates of the kept modes (k) and of the rest (g), and joints' forces (j).

    Parameters
    ----------
    kept, squares
        ω² of the kept modes (k,) and of the residual ones (n,).
    rest, answer
        Shapes in the residual modes: independent ones (n, g), and the answers to the forces (n, j).
    A
        Openings of the joints by the kept modes (j, k).
    series
        Flexibilities of the joints (j, j).
    """
    k, g, j = len(kept), rest.shape[1], len(A)
    K, M = np.zeros((k + g + j,) * 2), np.eye(k + g + j)
    K[:k, :k] = np.diag(kept)
    K[k : k + g, k : k + g] = rest.T @ (squares[:, None] * rest)
    K[:k, k + g :], K[k + g :, :k] = -A.T, -A
    K[k + g :, k + g :] = -(answer.T @ (squares[:, None] * answer) + series)
    M[k : k + g, k : k + g] = rest.T @ rest
    M[k : k + g, k + g :] = rest.T @ answer
    M[k + g :, k : k + g] = M[k : k + g, k + g :].T
    M[k + g :, k + g :] = answer.T @ answer
    return K, M


def unjoined(assembly: Assembly, joints: Sequence[Joint]) -> list[int]:
    """Indices of the interfaces at which there is no joint."""
    joined = {end for joint in joints for end in (joint.a, joint.b)}
    return [i for i, place in enumerate(assembly.places) if place not in joined]


def beside(answer: FloatArray, others: FloatArray, squares: FloatArray) -> FloatArray:
    """The shapes among ``others`` (n, k) that are independent of ``answer`` (n, j) and each other.

    Lengths and angles are those of strain energy.
    """
    stiff = np.sqrt(squares)[:, None]
    found: list[FloatArray] = []
    for shape in others.T:
        before = stiff * np.column_stack([answer, *found])
        energy = stiff[:, 0] * shape
        left = energy - before @ np.linalg.lstsq(before, energy, rcond=None)[0]
        if np.linalg.norm(left) > OTHER * np.linalg.norm(energy):
            found.append(shape / np.linalg.norm(energy))
    return np.column_stack(found) if found else np.zeros((squares.size, 0))


def side_by_side(components: Mapping[str, ReducedModel]) -> Assembly:
    """The components without joints."""
    models = list(components.values())
    sizes = [model.basis.shape[0] for model in models]
    ends = np.cumsum(sizes)
    return Assembly(
        places=[(name, at) for name, model in components.items() for at in model.interfaces],
        omega=np.concatenate([2.0 * np.pi * model.frequencies_hz for model in models]),
        rows=linalg.block_diag(*[rows_of(model) for model in models]),
        flexibility=linalg.block_diag(*[massless_of(model) for model in models]),
        damping=linalg.block_diag(*[damping_of(model) for model in models]),
        basis=linalg.block_diag(*[model.basis for model in models]),
        shapes=linalg.block_diag(*[shapes_of(model) for model in models]),
        load_vectors=tuple(
            f"{name}.{at}" for name, model in components.items() for at in model.load_vectors
        ),
        left_out_hz=tuple(hz for model in models for hz in model.left_out_hz),
        components={
            name: (int(end - size), int(end))
            for name, size, end in zip(components, sizes, ends, strict=True)
        },
    )


def rows_of(model: ReducedModel) -> FloatArray:
    """Participations (m, r)."""
    return np.array([model.participation[name] for name in model.interfaces]).reshape(
        -1, model.size
    )


def damping_of(model: ReducedModel) -> FloatArray:
    """Damping matrix (r, r), zero if there is none."""
    return np.zeros((model.size,) * 2) if model.damping is None else model.damping


def massless_of(model: ReducedModel) -> FloatArray:
    """Massless flexibility (m, m), zero if there is none."""
    m = len(model.interfaces)
    return np.zeros((m, m)) if model.residual_flexibility is None else model.residual_flexibility


def shapes_of(model: ReducedModel) -> FloatArray:
    """Shapes of the massless flexibility (N, m), zero if there is none."""
    shape = model.basis.shape[0], len(model.interfaces)
    return np.zeros(shape) if model.residual_shapes is None else model.residual_shapes


def joint_scale(A: FloatArray, omega: FloatArray, weights: FloatArray) -> float:
    """Flexibility of the components between the joints, the measure of a rigid joint."""
    elastic = omega > 0.0
    modal = A[:, elastic] / omega[elastic]
    return float(np.max(np.sum(modal**2, axis=1), initial=0.0) + np.max(weights, initial=0.0))


def null_space(conditions: FloatArray, size: int) -> FloatArray:
    """Orthonormal basis (n, n - rank) of the vectors that meet conditions (j, n)."""
    length = np.linalg.norm(conditions, axis=1)
    conditions = conditions[length > 0.0] / length[length > 0.0, None]
    if conditions.shape[0] == 0:
        return np.eye(size)
    return np.asarray(linalg.null_space(conditions, rcond=DEPENDENT))


def damper_matrix(assembly: Assembly, joints: Sequence[Joint]) -> FloatArray:
    """Damping matrix (n, n) of the joints' dampers."""
    D = np.zeros((assembly.omega.size,) * 2)
    for row, joint in zip(assembly.joint_rows(joints), joints, strict=True):
        if joint.damping == 0.0 or joint.stiffness is None:
            continue
        if np.any(row @ assembly.flexibility):
            raise ReductionError(
                f"a damper at {shown(joint)} needs components whose interfaces have mass: reduce "
                "them by 'rubin' or 'craig-bampton', not by 'macneal'"
            )
        speed = row @ assembly.rows
        D += joint.damping * np.outer(speed, speed)
    return D


def model_of(
    assembly: Assembly,
    omega: FloatArray,
    rows: FloatArray,
    basis: FloatArray,
    *,
    damping: FloatArray,
    flexibility: FloatArray,
    shapes: FloatArray,
    method: str,
) -> ReducedModel:
    """The coupled model; parts that are zero throughout are left out."""
    if omega.size == 0:
        raise ReductionError("the joints leave nothing that moves")
    names = [f"{component}.{interface}" for component, interface in assembly.places]
    flexibility = (flexibility + flexibility.T) / 2
    before = np.sqrt(np.diag(assembly.flexibility))
    if np.any(before):
        flexibility[np.abs(flexibility) <= ROUNDED * np.outer(before, before)] = 0.0
    massless = bool(np.any(flexibility))
    return ReducedModel(
        frequencies_hz=omega / (2.0 * np.pi),
        participation=dict(zip(names, rows, strict=True)),
        basis=basis,
        residuals=np.full(omega.size, np.inf),
        modes=int(omega.size),
        method=method,
        damping=(damping + damping.T) / 2 if np.any(damping) else None,
        residual_flexibility=flexibility if massless else None,
        residual_shapes=shapes if massless else None,
        components=assembly.components,
        load_vectors=assembly.load_vectors,
        left_out_hz=assembly.left_out_hz,
    )


def check_components(components: Mapping[str, ReducedModel]) -> None:
    """Raise ReductionError unless there are reduced models with plain names."""
    if not components:
        raise ReductionError("there is no component to couple")
    for name, model in components.items():
        if not isinstance(model, ReducedModel):
            kind = type(model).__name__
            raise ReductionError(f"component '{name}' is a {kind}, it must be a reduced model")
        if not name:
            raise ReductionError("a component has no name")


def check_joints(components: Mapping[str, ReducedModel], joints: Sequence[Joint]) -> None:
    """Raise ReductionError where a joint cannot be made."""
    seen = set()
    for joint in joints:
        if not isinstance(joint, Joint):
            raise ReductionError(f"a joint is a cms.Joint, not {joint!r}"[:200])
        ends = [joint.a] if joint.b is None else [joint.a, joint.b]
        for component, interface in ends:
            if component not in components:
                known = ", ".join(components)
                raise ReductionError(
                    f"{shown(joint)}: there is no component '{component}' (there are: {known})"
                )
            if interface not in components[component].participation:
                known = ", ".join(components[component].interfaces) or "none"
                raise ReductionError(
                    f"{shown(joint)}: component '{component}' has no interface '{interface}' "
                    f"(there are: {known})"
                )
        if len(set(ends)) < len(ends):
            raise ReductionError(f"{shown(joint)} joins an interface with itself")
        if joint.stiffness is not None:
            positive(f"the stiffness of {shown(joint)}", joint.stiffness)
        if not math.isfinite(joint.damping) or joint.damping < 0.0:
            raise ReductionError(
                f"{shown(joint)} has the damping {joint.damping}, it must not be negative"
            )
        if joint.damping and joint.stiffness is None:
            raise ReductionError(
                f"{shown(joint)} is rigid, so that its damping has no effect; give a stiffness"
            )
        key = frozenset(ends)
        if key in seen and joint.stiffness is None:
            raise ReductionError(f"{shown(joint)} is given twice")
        seen.add(key)


def shown(joint: Joint) -> str:
    """The joint in words."""
    other = "the ground" if joint.b is None else "'{}.{}'".format(*joint.b)
    return "the joint of '{}.{}' and {}".format(*joint.a, other)
