"""Pictures, animations and pages of deflected frames and structures with their true sections."""

from fem.render.frame_scenery import StopSphere
from fem.render.gl import RenderError, gl_available
from fem.render.page import write_page
from fem.render.pictures import VIEWS, animate, render_comparison, render_modes, render_shape
from fem.render.several import Several

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
    "write_page",
]
