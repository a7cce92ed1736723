"""A component's matrices, checked; how many digits they have, and what has no mass."""
