"""From a component to a few modal coordinates."""
