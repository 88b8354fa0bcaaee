"""How a lens or a whole skylight scatters light, measured or traced."""
