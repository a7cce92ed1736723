"""One periodic orbit: the names that are not in the face of nldyn."""

from nldyn.orbits.harmonics import Harmonics as Harmonics
from nldyn.orbits.history import History as History
from nldyn.orbits.multipliers import Stability as Stability
from nldyn.orbits.starts import OrbitSearchOptions as OrbitSearchOptions
