"""The parts of the pipeline in their order."""

from tireroad.runs.stages.accuracy import AccuracyStage
from tireroad.runs.stages.base.stage import Part
from tireroad.runs.stages.companions.coarser import STATIC_TO_GREENS
from tireroad.runs.stages.contact import ContactStage
from tireroad.runs.stages.motion import MotionStage
from tireroad.runs.stages.response import ResponseStage
from tireroad.runs.stages.spectra import SpectraStage
from tireroad.runs.stages.static import StaticStage
from tireroad.runs.stages.stiffness import StiffnessStage
from tireroad.runs.stages.vibration import VibrationStage

PARTS: tuple[type[Part], ...] = (
    StaticStage,
    StiffnessStage,
    *STATIC_TO_GREENS,
    ContactStage,
    AccuracyStage,
    ResponseStage,
    SpectraStage,
    VibrationStage,
    MotionStage,
)

"""Each takes its inputs by name from the parts before it."""
