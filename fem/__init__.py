"""The tire as a finite-element body: mesh, materials, equilibrium, matrices at a static state."""

from tireroad.fem.exports import exported

_HOMES = {
    "Axle": "axle",
    "Body": "tire.body",
    "Column": "cavity.column",
    "ConvergenceError": "errors",
    "Cords": "tire.cords",
    "Equilibrium": "static.equilibrium",
    "FullTire": "transient.linear",
    "InputError": "errors",
    "LoadStepper": "static.load_steps",
    "Material": "tire.material",
    "MaterialLaw": "tire.material",
    "NonlinearTire": "transient.nonlinear",
    "Operators": "matrices.operators",
    "ParameterError": "parameters",
    "Parameters": "parameters",
    "Region": "tire.mesh",
    "Ring": "sections.ring",
    "SectionMesh": "sections.mesh2d",
    "SmallMotions": "model",
    "StaticState": "static.state",
    "TireModel": "model",
    "Torus": "sections.torus",
    "Turning": "turning",
    "compound": "tire.material",
    "dilatation": "kinematics",
    "directed": "matrices.probe",
    "isochoric": "kinematics",
    "load_curve": "static.load_curve",
    "material_law": "tire.material",
    "press": "static.press",
    "radial": "sections.radial",
    "spot": "matrices.probe",
}
__all__ = sorted(_HOMES)
__getattr__, __dir__ = exported(__name__, _HOMES)
