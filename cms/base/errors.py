"""The one error that this package raises."""


class ReductionError(ValueError):
    """A component that cannot be reduced as asked; the text is one sentence that says why."""
