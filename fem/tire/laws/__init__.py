"""The material laws: `model` of a material in a scene picks one (fem.tire.law)."""
