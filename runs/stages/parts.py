"""The parts of the pipeline in their order."""

from tireroad.runs.stages.accuracy import AccuracyStage
from tireroad.runs.stages.base.stage import Part
from tireroad.runs.stages.build.cavity import AirColumn
from tireroad.runs.stages.build.setup import Setup
from tireroad.runs.stages.contact import ContactStage
from tireroad.runs.stages.greens import GreensStage
from tireroad.runs.stages.modes import Fields, ModesStage, Motions
from tireroad.runs.stages.motion import MotionStage
from tireroad.runs.stages.response import ResponseStage
from tireroad.runs.stages.rotating import FullMatrices, RotatingStage
from tireroad.runs.stages.spectra import SpectraStage
from tireroad.runs.stages.static import StaticStage
from tireroad.runs.stages.stiffness import StiffnessStage
from tireroad.runs.stages.vibration import VibrationStage

PARTS: tuple[type[Part], ...] = (
    StaticStage,
    StiffnessStage,
    Motions,
    Setup,
    ModesStage,
    AirColumn,
    Fields,
    FullMatrices,
    RotatingStage,
    GreensStage,
    ContactStage,
    AccuracyStage,
    ResponseStage,
    SpectraStage,
    VibrationStage,
    MotionStage,
)

"""Each takes, by name, what stands before it."""
