"""The material laws; `model` of a material in a scene selects one (fem.tire.material)."""
