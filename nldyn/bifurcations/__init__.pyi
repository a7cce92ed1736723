"""Special points: the names that are not in the face of nldyn."""

from nldyn.bifurcations.normal_forms import NormalForm as NormalForm
