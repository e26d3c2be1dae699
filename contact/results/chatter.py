"""Chatter: points that open and close from step to step because the step is too long.

At the touching points a force acts on an instantaneous compliance B (tread and residual
flexibility). To an alternating force, linear over the steps, the tire's states respond as a
negative compliance X (greens.recursion). With

    -X v = mu B v,   mu the largest,

the fastest oscillation of the touching points takes  2 pi / theta  steps,
cos theta = (1 - 4 mu) / (1 + 2 mu). A mass m on a compliance C has mu = h^2 / (12 m C); its true
oscillation rotates by (12 mu)^1/2 in a step. At mu = 1 it takes two steps, and beyond it grows
without bound. Horizontal forces act on bristles and on the tread's shear in the same way; the
larger mu of the two counts. Damped and constant forces (greens.recursion) have X >= 0: they damp such
an oscillation, with an error of second and of first order in the step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from tireroad.contact.model import ContactSpec, touching_compliance, tread_shear
from tireroad.contact.patch import Patch
from tireroad.contact.tread.between_nodes import without
from tireroad.fem.errors import ConvergenceError
from tireroad.greens.recursion import alternating, at_once
from tireroad.greens.response import Response

Stiffness = float | np.ndarray

# Steps in the fastest oscillation from which forces are taken as linear at first. Undamped modes
# gained energy between impacts at 2.9 steps and fewer (contact force a hundred times too large);
# where the choice is wrong, LIMIT and the bound on growth find out in the loop.
FEWEST = 2.5
# Points for which the oscillation is computed, half as many for horizontal forces: a second of
# eigenvalues.
MOST = 1000
# Largest accepted share of the touching points that alternate: that return to their state of two
# steps before. (Measured: 0.11 to 1 where forces were wrong, 0.035 at most where they were right.)
LIMIT = 0.05
WINDOW = 200  # steps over which it is counted


ANY = 1e9  # a limit that no share reaches: another scheme is tried only if the motion grows


class Chatter(ConvergenceError):
    """The steps are too long for the contact.

    Points open and close from step to step, or the motion grows without bound.
    """


@dataclass(frozen=True)
class Chosen:
    """The force's course within a step (greens.recursion), and the reason for it.

    `limit`: the share of points that open and close from step to step above which another is
    tried; inf if this one is final.
    """

    scheme: str
    reason: str
    limit: float = math.inf

    def next_scheme(self, chatter: Chatter) -> Chosen:
        """The choice after this one exceeded its limit; raises the error if none is left.

        On a rough road points open and close, too, because it passes by a good part of their
        spacing in a step. They do so with damped forces, which cannot chatter: these stay, unless
        the motion grows.
        """
        if self.limit == math.inf:
            raise chatter
        if self.scheme == "linear":
            return Chosen(
                "damped",
                "forces linear over the step made points open and close from step to step",
                ANY,
            )
        return Chosen("constant", "with damped forces too the motion grew without bound")


def choose(steps: float) -> Chosen:
    """The choice if the fastest oscillation of the contact takes this many `steps`."""
    if steps >= FEWEST:
        why = "resolve" if math.isfinite(steps) else "have none to resolve:"
        count = f" in {steps:.3g} steps" if math.isfinite(steps) else ""
        return Chosen("linear", f"the steps {why} the contact's fastest oscillation{count}", LIMIT)
    return Chosen(
        "damped",
        f"the contact's fastest oscillation takes {steps:.3g} steps, fewer than {FEWEST:g}: forces linear over "
        "the step would chatter",
        ANY,
    )


# With forces linear over the step 300 modes grew without bound at steps of 0.2 ms (docs/large-motions.md).
LARGE = Chosen(
    "damped",
    "the nonlinear force of large motions acts on the modes as springs many times as stiff as the tire",
    ANY,
)


def oscillation(
    spec: ContactSpec,
    patch: Patch,
    response: Response,
    step: float,
    bristles: Stiffness | None = None,
    resolved: np.ndarray | None = None,
) -> float:
    """Steps (2 or more, inf) per fastest oscillation of points touching at rest, linear forces.

    `step` in s. `response` as the loop uses it (Response.resolved); its first inputs and outputs
    are the patch's nodes, with horizontal forces in z, then x and y. `bristles` N/m of each point,
    inf if rigid, None: no horizontal forces. `resolved` m/N: what the nodes have of the tread (ContactSetup). The points are taken to stick, so the result is a
    lower bound. Of more than `MOST` points those nearest to their middle are taken.
    """
    index = _nearest(patch, MOST)
    if len(index) == 0:
        return math.inf
    p = len(patch.index)
    whole = -alternating(response, step), without(at_once(response), resolved)
    seen = [matrix[:p, :p] for matrix in whole]
    approach = _between(patch, seen[0], index)
    mu = _largest(approach, touching_compliance(spec, patch, seen[1], index))
    if bristles is not None:
        along = [matrix[p : 3 * p, p : 3 * p] for matrix in whole]
        mu = max(mu, _along(spec, patch, along, bristles))
    return _steps(mu)


def _along(spec: ContactSpec, patch: Patch, seen: list[np.ndarray], bristles: Stiffness) -> float:
    """mu of the points' horizontal forces, `seen` by nodes (2 p, 2 p), x then y."""
    index, p = _nearest(patch, MOST // 2), len(patch.index)
    approach, compliance = (
        np.block(
            [[_between(patch, matrix[a : a + p, b : b + p], index) for b in (0, p)] for a in (0, p)]
        )
        for matrix in seen
    )
    shear = tread_shear(spec, patch)
    if shear is not None:
        compliance = compliance + shear.matrix(index)
    own = 1.0 / np.broadcast_to(bristles, len(patch.force))[index]
    return _largest(approach, compliance + np.diag(np.tile(own, 2)))


def _between(patch: Patch, nodes: np.ndarray, index: np.ndarray) -> np.ndarray:
    """W nodes W^T (n, n) between the points of the `index`."""
    if patch.weights is None:
        return nodes[np.ix_(index, index)]
    rows = patch.weights[index]
    return rows @ (rows @ nodes.T).T


def _nearest(patch: Patch, most: int) -> np.ndarray:
    """The points that touch at rest, at most `most` of them, nearest to their middle."""
    index = np.flatnonzero(patch.force > 0)
    if len(index) <= most:
        return index
    place = patch.points[index, :2]
    away = ((place - place.mean(axis=0)) ** 2).sum(axis=1)
    return np.sort(index[np.argsort(away, kind="stable")[:most]])


def _largest(approach: np.ndarray, compliance: np.ndarray) -> float:
    """Largest mu for the symmetric parts (n, n); inf if the compliance is not definite."""
    last = [len(approach) - 1] * 2
    symmetric = [(matrix + matrix.T) / 2 for matrix in (approach, compliance)]
    try:
        return float(linalg.eigh(*symmetric, eigvals_only=True, subset_by_index=last)[0])
    except np.linalg.LinAlgError:  # not positive definite: no instantaneous compliance
        return math.inf


def _steps(mu: float) -> float:
    """Steps per period of the oscillation of that mu."""
    if mu <= 0.0:
        return math.inf
    # cos a = (1 - 4 mu) / (1 + 2 mu) for the angle a per step, evaluated by a / 2: the cosine of a
    # small angle is lost in rounding.
    half = 3 * mu / (1 + 2 * mu) if math.isfinite(mu) else 1.0
    return math.pi / math.asin(math.sqrt(min(half, 1.0)))


def warning(share: float) -> str:
    """The warning for a share of points that open and close."""
    return (
        f"contact: {100 * share:.2g} % of the points that touch open and close from step to step: take a smaller "
        'time.step, or time.scheme = "constant"'
    )


class Alternation:
    """Counts, as the loop proceeds, the touching points that change back in every step.

    An event is a point that touches or not as two steps before, but not as in the step between.
    `worst` is the largest ratio of events to touching points over all windows of `WINDOW` steps.
    """

    def __init__(self) -> None:
        self.worst = 0.0
        self._last = np.zeros((0, 0), dtype=bool)
        self._window = np.zeros(3, dtype=np.int64)  # steps, events, touching points

    def add(self, force: np.ndarray) -> None:
        """Count n steps: forces (n, c) N."""
        active = force > 0
        rows = np.concatenate([self._last.reshape(-1, active.shape[1]), active])
        back = (rows[2:] == rows[:-2]) & (rows[2:] != rows[1:-1])
        events = np.zeros(len(active), dtype=np.int64)
        events[len(active) - len(back) :] = back.sum(axis=1)
        # Windows begin at the first step, so they do not depend on how steps are blocked.
        for now in zip(events.tolist(), active.sum(axis=1).tolist(), strict=True):
            self._window += (1, *now)
            if self._window[0] == WINDOW:
                self._close()
        self._last = rows[-2:]

    def finish(self) -> None:
        """Count the last, incomplete window, unless it is too short to be meaningful."""
        if self._window[0] >= WINDOW // 4:
            self._close()

    def _close(self) -> None:
        steps, back, touching = self._window.tolist()
        self.worst = max(self.worst, back / max(touching, steps))
        self._window[:] = 0

    def check(self, limit: float) -> None:
        """Raise Chatter if more than this share of the points change back."""
        if self.worst > limit:
            raise Chatter(warning(self.worst))

    def state(self) -> dict[str, np.ndarray]:
        """The state that a checkpoint keeps."""
        return {
            "alternation": np.array(self.worst),
            "alternation_window": self._window,
            "alternation_last": self._last,
        }

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Continue from `state`."""
        self.worst = float(state["alternation"])
        self._window, self._last = state["alternation_window"].copy(), state["alternation_last"]
