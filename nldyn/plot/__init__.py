"""Pictures of results with matplotlib."""

from nldyn.plot.basin_shares import plot_basins_over
from nldyn.plot.curves import plot_curves
from nldyn.plot.diagram import plot_diagram
from nldyn.plot.longterm import (
    plot_basins,
    plot_brute_force,
    plot_section,
    plot_spectra,
    plot_sweep,
    plot_wear,
)
from nldyn.plot.mac import plot_mac
from nldyn.plot.orbit import plot_contact_force, plot_history, plot_phase_portrait, plot_spectrum

__all__ = [
    "plot_basins",
    "plot_basins_over",
    "plot_brute_force",
    "plot_contact_force",
    "plot_curves",
    "plot_diagram",
    "plot_history",
    "plot_mac",
    "plot_phase_portrait",
    "plot_section",
    "plot_spectra",
    "plot_spectrum",
    "plot_sweep",
    "plot_wear",
]
