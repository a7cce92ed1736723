"""How good a reduced model is: checks against its component, bands of its error."""
