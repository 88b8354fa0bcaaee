"""Mechanisms: physics that a prediction may have left out, one class each."""
