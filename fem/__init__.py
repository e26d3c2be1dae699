"""The tire as a finite-element body: mesh, materials, equilibrium, matrices at a static state."""

from tireroad.fem.exports import exported

_HOMES = {
    "Axle": "wheel",
    "Body": "tire.body",
    "Column": "cavity",
    "ConvergenceError": "errors",
    "Cords": "tire.cords",
    "Equilibrium": "static.equilibrium",
    "FullTire": "transient",
    "InputError": "errors",
    "LoadStepper": "static.load_steps",
    "Material": "tire.material",
    "MaterialLaw": "tire.material",
    "NonlinearTire": "transient",
    "Operators": "matrices.operators",
    "ParameterError": "parameters",
    "Parameters": "parameters",
    "Region": "tire.mesh",
    "Ring": "sections.mesh2d",
    "SectionMesh": "sections.mesh2d",
    "SmallMotions": "model",
    "StaticState": "static.state",
    "TireModel": "model",
    "Torus": "sections.torus",
    "Turning": "wheel",
    "compound": "tire.material",
    "dilatation": "kinematics",
    "directed": "matrices.probe",
    "isochoric": "kinematics",
    "load_curve": "static.press",
    "material_law": "tire.material",
    "press": "static.press",
    "radial": "sections.radial",
    "spot": "matrices.probe",
}
__all__ = sorted(_HOMES)
__getattr__, __dir__ = exported(__name__, _HOMES)
