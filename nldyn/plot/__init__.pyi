"""Pictures of results with matplotlib."""

from nldyn.plot.basin_shares import plot_basins_over as plot_basins_over
from nldyn.plot.contact import plot_friction_loss as plot_friction_loss
from nldyn.plot.contact import plot_pressure as plot_pressure
from nldyn.plot.contact import plot_wear_around as plot_wear_around
from nldyn.plot.curves import plot_curves as plot_curves
from nldyn.plot.diagram import plot_diagram as plot_diagram
from nldyn.plot.longterm import plot_basins as plot_basins
from nldyn.plot.longterm import plot_brute_force as plot_brute_force
from nldyn.plot.longterm import plot_section as plot_section
from nldyn.plot.longterm import plot_spectra as plot_spectra
from nldyn.plot.longterm import plot_sweep as plot_sweep
from nldyn.plot.longterm import plot_wear as plot_wear
from nldyn.plot.mac import plot_mac as plot_mac
from nldyn.plot.orbit import plot_contact_force as plot_contact_force
from nldyn.plot.orbit import plot_history as plot_history
from nldyn.plot.orbit import plot_phase_portrait as plot_phase_portrait
from nldyn.plot.orbit import plot_spectrum as plot_spectrum
