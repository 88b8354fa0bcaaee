"""From bracketed exposures to a luminance map with its uncertainty."""
