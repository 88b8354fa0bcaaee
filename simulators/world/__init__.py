"""The one world all emulated instruments observe."""
