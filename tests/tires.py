"""The tires that scenes of the tests share, as texts of TOML tables."""


def soft_torus(segments: int, elements_arc: int, **tire: float) -> str:
    """[tire] and [tire.material] of a torus of 48 MPa; `tire`: further keys of [tire]."""
    keys = {"segments": segments, "elements_arc": elements_arc, **tire}
    table = "".join(f"{name} = {value}\n" for name, value in keys.items())
    return f"[tire]\n{table}[tire.material]\nyoungs_modulus = 48e6\n"
