"""Blind trials: cases with a concealed cause, the answers to them, and the score."""
