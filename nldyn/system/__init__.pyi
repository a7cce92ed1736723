"""What is computed: the names that are not in the face of nldyn."""

from nldyn.system.chart import OwnParameter as OwnParameter
from nldyn.system.contact_law import CompiledLaw as CompiledLaw
from nldyn.system.equilibrium import closed_at_rest as closed_at_rest
from nldyn.system.equilibrium import rest as rest
from nldyn.system.equilibrium import rest_positions as rest_positions
from nldyn.system.friction import DryFriction as DryFriction
from nldyn.system.friction import Friction as Friction
from nldyn.system.friction import Slider as Slider
from nldyn.system.measured import MeasuredForce as MeasuredForce
from nldyn.system.springs_dampers import CubicDamper as CubicDamper
