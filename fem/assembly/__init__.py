"""From a model to stiffness, mass and interfaces."""
