"""Families of orbits in the frequency: the names that are not in the face of nldyn."""

from nldyn.branches.cascades import Cascade as Cascade
