"""Recordings beside simulations: cases for the explanation."""
