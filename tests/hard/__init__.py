"""Cases that are hard for programs of this kind, each with a known answer or a bound."""
