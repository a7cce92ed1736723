"""Speed against error: the flow map beside general integrators."""
