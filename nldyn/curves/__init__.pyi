"""Families in two parameters: the names that are not in the face of nldyn."""

from nldyn.curves.backbone import Backbone as Backbone
from nldyn.curves.curves import Curve as Curve
from nldyn.curves.refine import refine_special as refine_special
