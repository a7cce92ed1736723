"""A string of masses held at both ends, which hits a stop in its middle."""

import numpy as np
from scipy import sparse

import cms
from nldyn import LoadCase, Stop, Unbalance

MASSES, MASS, SPRING = 41, 0.05, 141000.0
SETTING = LoadCase(
    (30.0, 45.0),
    stops=(Stop("middle", stiffness=2e7),),
    excitation=(Unbalance("middle", 2e-4),),
    modal_damping=0.03,
)


def string(extra=None) -> cms.Matrices:
    """Frequencies from 20 to 534 Hz; every second mode has a node in the middle."""
    off = -np.ones(MASSES - 1)
    K = SPRING * sparse.diags_array([off, np.full(MASSES, 2.0), off], offsets=[-1, 0, 1])
    loads = {"middle": np.eye(MASSES)[MASSES // 2], **(extra or {})}
    return cms.Matrices(K.tocsc(), MASS * sparse.eye_array(MASSES, format="csc"), loads)
