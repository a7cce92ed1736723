"""Whether this machine can render off-screen, found out without risking a crash."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
import textwrap
from importlib.util import find_spec

EGL_VARIABLE = "VTK_DEFAULT_OPENGL_WINDOW"
EGL_WINDOW = "vtkEGLRenderWindow"
WINDOWLESS = (EGL_WINDOW, "vtkOSOpenGLRenderWindow")
ADVICE = (
    "pictures of the frame need a GL library, which this machine lacks: on Debian or Ubuntu, "
    "install libegl1 and libgl1-mesa-dri (apt-get install libegl1 libgl1-mesa-dri)"
)
PROBE = textwrap.dedent(
    """
    import pyvista
    plotter = pyvista.Plotter(off_screen=True, window_size=(32, 32))
    plotter.add_mesh(pyvista.Sphere(), color="red")
    image = plotter.screenshot(None, return_img=True)
    assert image.std() > 0
    print("rendered", flush=True)
    """
)
PROBE_SECONDS = 180.0


MISSING = 'what is drawn of a mesh needs {}, which {} not installed: pip install "nldyn[render]"'
LIBRARIES = ("pyvista", "imageio")


class RenderError(RuntimeError):
    """A picture that cannot be made here; the text is one sentence that says what to do."""


def gl_available() -> tuple[bool, str]:
    """Whether off-screen pictures can be made, and if not, what to install.

    The first call renders a small sphere in another process, because without a GL library
    VTK does not raise an exception but ends the process. The answer is kept for this process.
    Without a display, ``VTK_DEFAULT_OPENGL_WINDOW`` is set so that VTK renders through EGL,
    unless it is set already.

    Returns
    -------
    available : bool
        True if pictures can be made.
    advice : str
        Empty, or one line that says what to install.

    Examples
    --------
    >>> from fem.render import gl_available
    >>> available, advice = gl_available()
    >>> available or "libegl1" in advice
    True
    """
    if missing := missing_library():
        return False, missing
    window = working_window()
    if window is None:
        return False, ADVICE
    if window:
        os.environ[EGL_VARIABLE] = window
    return True, ""


def missing_library() -> str:
    """One sentence on what is not installed of what draws meshes; empty if nothing is missing."""
    missing = [name for name in LIBRARIES if find_spec(name) is None]
    told = MISSING.format(" and ".join(missing), "are" if len(missing) > 1 else "is")
    return told if missing else ""


@functools.cache
def working_window() -> str | None:
    """The render window class that works: "" for VTK's own choice, or None if nothing does."""
    for window in candidate_windows():
        if renders(window):
            return window
    return None


def candidate_windows() -> list[str]:
    """Render windows worth a try, the likeliest first; "" leaves the choice to VTK."""
    given = os.environ.get(EGL_VARIABLE)
    if given or not sys.platform.startswith("linux"):
        return [given or ""]
    return ["", EGL_WINDOW] if os.environ.get("DISPLAY") else [EGL_WINDOW]


def renders(window: str) -> bool:
    """Whether another Python process can render a sphere with this render window class."""
    environment = dict(os.environ)
    if window:
        environment[EGL_VARIABLE] = window
    try:
        run = subprocess.run(
            [sys.executable, "-c", PROBE],
            env=environment,
            capture_output=True,
            timeout=PROBE_SECONDS,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return run.returncode == 0 and b"rendered" in run.stdout


def has_screen() -> bool:
    """Whether a window can be opened: there is a display, and VTK draws on it."""
    there = not sys.platform.startswith("linux") or bool(os.environ.get("DISPLAY"))
    return there and gl_available()[0] and on_screen()


def on_screen() -> bool:
    """Whether VTK, after `gl_available`, opens windows that can be seen."""
    return os.environ.get(EGL_VARIABLE) not in WINDOWLESS


def require_gl() -> None:
    """Raise RenderError if no picture can be made here."""
    available, advice = gl_available()
    if not available:
        raise RenderError(advice)


def require_library() -> None:
    """Raise RenderError if what draws meshes is not installed."""
    if missing := missing_library():
        raise RenderError(missing)
