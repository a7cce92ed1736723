"""The errors that nldyn raises for bad input."""


class SystemModelError(ValueError):
    """A system, stop, damper or excitation that cannot be modelled; one sentence says why."""


class SceneError(ValueError):
    """A scene file that cannot be used; one sentence names the file, the key and the reason."""
