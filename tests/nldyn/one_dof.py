"""The 1-DOF system of equation 3.1, and a mode between two linear stops."""

from nldyn import Stop, System, Unbalance

RANGE_HZ = (5.7, 90.0)
THREE_HZ = (36.0, 38.5)  # where there are branches of three periods up to 3


def make_one_dof(**changes) -> System:
    elements = {
        "stops": [Stop("middle", stiffness=5.17e9)],
        "excitation": [Unbalance("middle", 4.92e-6)],
        **changes,
    }
    return System.from_matrices(
        [[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=0.0142, **elements
    )


def between_stops(mismatch: float = 0.0) -> System:
    """A mode between two linear stops, one of them farther off by a share of the gap."""
    stops = [
        Stop("m", 1e6, 1.0, gap=5e-6),
        Stop("m", 1e6, 1.0, gap=5e-6 * (1.0 + mismatch), direction=-1),
    ]
    unbalance = [Unbalance("m", 4.92e-6)]
    return System.from_modal(
        [13.13], {"m": [0.635]}, modal_damping=0.02, stops=stops, excitation=unbalance
    )
