"""Scenes and parameter studies: the names that are not in the face of nldyn."""

from nldyn.scene.build import build_reduced as build_reduced
from nldyn.scene.build import build_system as build_system
from nldyn.scene.component import build_component as build_component
from nldyn.scene.load_case import load_case_of as load_case_of
from nldyn.scene.read import load_scene as load_scene
