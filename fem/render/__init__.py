"""Pictures, animations and pages of deflected structures with their true sections."""

from fem.render.gl import RenderError, gl_available
from fem.render.page import write_motion, write_page
from fem.render.pictures import animate, render_comparison, render_modes, render_shape
from fem.render.scenery import StopSphere
from fem.render.several import Several
from fem.render.views import VIEWS

__all__ = [
    "VIEWS",
    "RenderError",
    "Several",
    "StopSphere",
    "animate",
    "gl_available",
    "render_comparison",
    "render_modes",
    "render_shape",
    "write_motion",
    "write_page",
]
