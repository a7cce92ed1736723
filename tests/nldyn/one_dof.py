"""The 1-DOF system of equation 3.1."""

from nldyn import Stop, System, Unbalance

RANGE_HZ = (5.7, 90.0)


def make_one_dof(**changes) -> System:
    elements = {
        "stops": [Stop("middle", stiffness=5.17e9)],
        "excitation": [Unbalance("middle", 4.92e-6)],
        **changes,
    }
    return System.from_matrices(
        [[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=0.0142, **elements
    )
