"""What other programs need of a skylight: its solids, its BSDFs, a Radiance scene, and the rays that fall on it."""
