"""What is public here and not in the face of nldyn: the list is the stub beside this file."""

from pathlib import Path

from nldyn.base.face import face

__getattr__, __dir__, __all__ = face(__name__, Path(__file__).parent)
