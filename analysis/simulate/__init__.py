"""Predicted photometry of a skylight under a given sky and sun."""
