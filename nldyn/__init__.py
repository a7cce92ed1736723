"""Periodic orbits of reduced structures against stops: flow map, shooting, continuation.

The names are loaded when they are first asked for: `import nldyn` itself takes no time, so that
the command line answers at once. The list of them, with their homes, is ``nldyn/__init__.pyi``.
"""

from nldyn.base.face import face
from nldyn.base.version import __version__ as __version__
from nldyn.base.version import check_packages

check_packages()
__getattr__, __dir__, __all__ = face(__name__, __path__)
