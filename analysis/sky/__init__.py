"""Sun and sky: positions, luminance models, and the map the camera saw."""
