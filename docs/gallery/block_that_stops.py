"""A block that stops twice a cycle.

Pulled to and fro with $P\\cos\\omega t$ against a spring k and a friction force F, a block rests at
the ends of its swing where F is more than J. P. Den Hartog's (1931) limit. It leaves the end X at
the phase φ where $kX - P\\cos\\varphi = F$, slides for a time τ, and comes to rest at -X. That it
has no speed there gives φ for each τ, and that it is at -X gives F: in closed form, as it slides by
$F + PV\\cos\\omega t$ with $V = 1/(1 - \\beta^2)$ at the frequency β over its own, and freely.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

from nldyn import HarmonicForce, System, continue_branch, solve_orbit
from nldyn.system import DryFriction


def limit(beta):
    """F/P up to which it does not rest."""
    size, swing = 1.0 / (1.0 - beta**2), math.tan(0.5 * math.pi / beta) / beta
    return abs(size) / math.hypot(swing, beta**-2)


def closed_form(beta, resting):
    """F/P and the swing with which it rests for such a share of the time."""
    size, time = 1.0 / (1.0 - beta**2), math.pi * (1.0 - resting) / beta
    turn = beta * time
    phase = math.atan2(beta * math.sin(time) - math.sin(turn), math.cos(turn) - math.cos(time))
    cosine, sine = math.cos(phase % math.pi), math.sin(phase % math.pi)
    swung = cosine * (math.cos(turn) - beta**2 * math.cos(time))
    swung += sine * (beta * math.sin(time) - math.sin(turn))
    friction = -0.5 * (cosine + size * swung)
    return friction, friction + cosine


fig, (in_time, over_speed) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
for color, share in enumerate((0.8, 0.85, 0.9)):
    dry, pull = DryFriction("x", normal_force=1.0, friction=share), HarmonicForce("x", 1.0)
    block = System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]}, dampers=[dry], excitation=[pull])
    orbit = solve_orbit(block, 0.5 / (2.0 * math.pi))
    rests = orbit.friction[0].stuck
    known, swing = closed_form(0.5, rests)
    print(f"F/P {known:.9f} of {share}, swing {orbit.max_abs_displacement:.9f} of {swing:.9f}")
    assert abs(known / share - 1.0) < 1e-8
    assert abs(orbit.max_abs_displacement / swing - 1.0) < 1e-9
    history = orbit.history(1000)
    in_time.plot(history.time / orbit.duration, history.displacement["x"], f"C{color}")
    branch = continue_branch(orbit, (0.35 / (2.0 * math.pi), 1.4 / (2.0 * math.pi)))
    rests = np.array([point.friction[0].stuck for point in branch.points])
    beta = np.array([point.omega for point in branch.points])
    over_speed.plot(beta, rests, f"C{color}", label=f"F/P = {share}")
    assert ((rests > 0.0) == (share > np.array([limit(each) for each in beta]))).all()
in_time.set(xlabel="time over the period", ylabel="displacement k x / P", title="β = 0.5")
over_speed.set(xlabel="frequency over the natural one β", ylabel="share of the time at rest")
over_speed.legend()
