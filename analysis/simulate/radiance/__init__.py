"""The second engine: Radiance, asked backwards from the aperture."""
