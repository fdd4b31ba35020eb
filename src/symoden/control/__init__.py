"""Controllers from the energy."""
