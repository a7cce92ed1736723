"""All branches: the names that are not in the face of nldyn."""

from nldyn.search.diagram import SubharmonicSeed as SubharmonicSeed
from nldyn.search.exploration import Exploration as Exploration
from nldyn.search.fixed_point_index import index_gaps as index_gaps
from nldyn.search.mixtures import Mixtures as Mixtures
from nldyn.search.pseudo_orbits import PseudoOrbits as PseudoOrbits
from nldyn.search.random_walks import ClosedWalks as ClosedWalks
