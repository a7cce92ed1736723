"""Pictures of results with matplotlib; the stub beside lists what is public."""

from nldyn.base.face import face

__getattr__, __dir__, __all__ = face(__name__, __path__)
