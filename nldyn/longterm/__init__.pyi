"""What motions do: the names that are not in the face of nldyn."""

from nldyn.longterm.attractors import Attractor as Attractor
from nldyn.longterm.attractors import AttractorOptions as AttractorOptions
from nldyn.longterm.attractors import Attractors as Attractors
from nldyn.longterm.basin_shares import basins_over as basins_over
from nldyn.longterm.basins import Basins as Basins
from nldyn.longterm.initial_states import state_with as state_with
from nldyn.longterm.lifetimes import chaos_lifetime as chaos_lifetime
from nldyn.longterm.manifolds import basin_edge as basin_edge
from nldyn.longterm.manifolds import stable_manifold as stable_manifold
from nldyn.longterm.measures import contact_measures as contact_measures
from nldyn.longterm.measures import measures_table as measures_table
from nldyn.longterm.measures import power_spectrum as power_spectrum
from nldyn.longterm.measures import spectra_map as spectra_map
from nldyn.longterm.measures import spectra_table as spectra_table
from nldyn.longterm.poincare import brute_force as brute_force
from nldyn.longterm.poincare import impact_section as impact_section
from nldyn.longterm.poincare import stroboscopic_section as stroboscopic_section
