"""The prescribed forces of a scene as functions of time."""

from collections.abc import Sequence

import numpy as np

from tireroad.runs.scene.tables.scene import PointForce


def directions(forces: Sequence[PointForce]) -> np.ndarray:
    """Unit vectors of the forces, (k, 3)."""
    given = np.array([force.direction for force in forces]).reshape(-1, 3)
    return given / np.linalg.norm(given, axis=1, keepdims=True)


def histories(forces: Sequence[PointForce], time: np.ndarray, order: int = 0) -> np.ndarray:
    """The forces (nt, k) N: amplitude sin(2 pi f t), or the constant amplitude if f = 0.

    `order`: order of the time derivative, N/s^order.
    """
    columns = [_history(force, time, order) for force in forces]
    return np.stack(columns, axis=-1) if columns else np.zeros((len(time), 0))


def shortest_period(forces: Sequence[PointForce]) -> float:
    """Period of the fastest force, s; infinite if all are constant."""
    fastest = max((force.frequency for force in forces), default=0.0)
    return 1 / fastest if fastest else np.inf


def _history(force: PointForce, time: np.ndarray, order: int) -> np.ndarray:
    if force.frequency == 0:
        return np.full(len(time), force.amplitude if order == 0 else 0.0)
    omega = 2 * np.pi * force.frequency
    return force.amplitude * omega**order * np.sin(omega * time + order * np.pi / 2)
