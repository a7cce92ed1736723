"""Compiled entry points: several segments in one call, with plain arrays as arguments.

Plain arrays pass into compiled code far faster than named tuples; inside, they are put together.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from nldyn._flight import FlowData
from nldyn._segment import OK, Record, propagate
from nldyn.gauss import GaussTables


@njit(cache=True, nogil=True)
def shoot(
    eigenvalues,
    rows,
    force,
    forced,
    d_forced,
    gap,
    stiffness,
    exponent,
    mobility,
    duration_factor,
    pack_mode,
    pack_unit,
    omega,
    tail,
    chi,
    integrate,
    weights,
    to_legendre,
    gauss_nodes,
    rec_phase,
    rec_duration,
    rec_kind,
    rec_w,
    rec_force,
    rec_count,
    nodes,
    phases,
    chained,
    with_columns,
    recording,
):
    """Propagate each node (k, 2n) to the next phase; see `propagate` for what comes back.

    When `chained`, only the first node is used and each segment starts where the last one ended.
    """
    fl = FlowData(
        eigenvalues,
        rows,
        force,
        forced,
        d_forced,
        gap,
        stiffness,
        exponent,
        mobility,
        duration_factor,
        pack_mode,
        pack_unit,
        omega,
        tail,
    )
    tab = GaussTables(chi, integrate, weights, to_legendre, gauss_nodes)
    rec = Record(rec_phase, rec_duration, rec_kind, rec_w, rec_force, rec_count)
    k = phases.size - 1
    size = pack_mode.size
    ends = np.zeros((k, size))
    kept = k if with_columns else 1
    jacobians = np.zeros((kept, size, size))
    d_omegas = np.zeros((kept, size))
    closings = np.zeros(gap.size, dtype=np.int64)
    for i in range(k):
        start = ends[i - 1] if chained and i > 0 else nodes[i]
        duration = (phases[i + 1] - phases[i]) / omega
        end, jacobian, d_omega, closed, status = propagate(
            fl, tab, start, phases[i], duration, with_columns, rec, recording
        )
        ends[i] = end
        if with_columns:
            jacobians[i] = jacobian
            d_omegas[i] = d_omega
        closings += closed
        if status != OK:
            return ends, jacobians, d_omegas, closings, status
    return ends, jacobians, d_omegas, closings, OK
