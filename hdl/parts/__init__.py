"""The parts of the block diagrams: small, each tested alone, composed by the methods."""

from discreta.hdl.parts.control_unit import ControlUnit
from discreta.hdl.parts.increment_register import IncrementRegister
from discreta.hdl.parts.normalizer import Normalizer
from discreta.hdl.parts.position_register import PositionRegister
from discreta.hdl.parts.radius_meter import RadiusMeter
from discreta.hdl.parts.remaining_counter import RemainingCounter
from discreta.hdl.parts.scale_converter import ScaleConverter
from discreta.hdl.parts.step_adder import StepAdder
from discreta.hdl.parts.summator import PRELOADS, Summator

__all__ = [
    "PRELOADS",
    "ControlUnit",
    "IncrementRegister",
    "Normalizer",
    "PositionRegister",
    "RadiusMeter",
    "RemainingCounter",
    "ScaleConverter",
    "StepAdder",
    "Summator",
]
