"""Chatter: points that open and close from step to step, because a step is too long for the contact.

Between the points that touch, a force meets a compliance at once, B (tread and residual flexibility); a force
linear over the steps that alternates meets the tire's states as a negative one, X (greens.residual.alternating). With

    -X v = mu B v,   mu the largest,

the fastest oscillation of the points that touch takes  2 pi / theta  steps,  cos theta = (1 - 4 mu) / (1 + 2 mu).
A mass m on a compliance C has mu = h^2 / (12 m C): its true oscillation turns by (12 mu)^1/2 in a step. At
mu = 1 it takes two steps, and from there on it grows without bound. Horizontal forces, where there are some, meet
bristles and the tread's shear likewise; the larger mu of the two counts. A force that is constant over the step has
X = 0: it takes from such an oscillation what it has, and errs by the first order of the step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from tireroad.contact.model import Spec, touching_compliance, tread_shear
from tireroad.contact.patch import Patch
from tireroad.fem.errors import ConvergenceError
from tireroad.greens.residual.alternating import alternating, at_once
from tireroad.greens.response import Response

Stiffness = float | np.ndarray

# Steps in the fastest oscillation from which forces are taken as linear: at fewer, undamped modes between impacts
# gained energy (measured from 2.9 down: contact force a hundred times too large).
FEWEST = 2.5
# Points of which the oscillation is found, along the road of half as many: a second of eigenvalues.
MOST = 1000
# Share of the points that touch, of which all but these came back to where they were two steps before.
# (Seen: 0.11 to 1 where forces were wrong, 0.035 at most where they were right.)
LIMIT = 0.05
WINDOW = 200  # steps over which it is counted


ROAD = "points open and close from step to step with constant forces too: that is the road, not chatter"


class Chatter(ConvergenceError):
    """The steps are too long for the contact: `share` of the points that touch open and close from step to step; inf
    where the motion grows without bound."""

    def __init__(self, text: str, share: float = math.inf) -> None:
        super().__init__(text)
        self.share = share


@dataclass(frozen=True)
class Chosen:
    """The force's course within a step, "linear" or "constant", and why; `limit`: the share of points that open and
    close from step to step beyond which the other is tried, inf where this one is kept."""

    scheme: str
    reason: str
    limit: float = math.inf

    def instead(self, chatter: Chatter) -> Chosen:
        """What to take after this one has gone beyond its limit; the error itself where nothing is left.

        On a rough road points open and close because it passes under them by more than their distance in a step. Then
        they do so with constant forces as well, which have no chatter: more than half as many, and linear it stays.
        """
        if self.scheme == "linear" and self.limit < math.inf:
            limit = max(chatter.share / 2, LIMIT)
            return Chosen(
                "constant",
                "forces linear over the step made points open and close from step to step",
                limit,
            )
        if chatter.share < math.inf and self.limit < math.inf:
            return Chosen("linear", ROAD)
        raise chatter


def choose(steps: float) -> Chosen:
    """What to take where the fastest oscillation of the contact takes so many `steps`."""
    if steps >= FEWEST:
        why = "resolve" if math.isfinite(steps) else "have none to resolve:"
        count = f" in {steps:.3g} steps" if math.isfinite(steps) else ""
        return Chosen("linear", f"the steps {why} the contact's fastest oscillation{count}", LIMIT)
    return Chosen(
        "constant",
        f"the contact's fastest oscillation takes {steps:.3g} steps, fewer than {FEWEST:g}: forces linear over "
        "the step would chatter",
    )


def oscillation(
    spec: Spec, patch: Patch, response: Response, step: float, bristles: Stiffness | None = None
) -> float:
    """Steps (2 or more, inf) that the fastest oscillation of the points touching at rest takes, with
    forces linear over steps of `step` s.

    `response` as the loop takes it (Response.resolved), its first inputs and outputs the patch's nodes, with horizontal
    forces in z, then x and y. `bristles` N/m of each point, inf where none give way, None: no horizontal forces; the
    points stick, so that it is their least number of steps. Of more than `MOST` points those nearest to their middle.
    """
    index = _nearest(patch, MOST)
    if len(index) == 0:
        return math.inf
    p = len(patch.index)
    whole = -alternating(response, step), at_once(response)
    seen = [matrix[:p, :p] for matrix in whole]
    approach = _between(patch, seen[0], index)
    mu = _largest(approach, touching_compliance(spec, patch, seen[1], index))
    if bristles is not None:
        along = [matrix[p : 3 * p, p : 3 * p] for matrix in whole]
        mu = max(mu, _along(spec, patch, along, bristles))
    return _steps(mu)


def _along(spec: Spec, patch: Patch, seen: list[np.ndarray], bristles: Stiffness) -> float:
    """mu of the points' horizontal forces, `seen` by nodes (2 p, 2 p), of x, then of y."""
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
    """The points that touch at rest, (n,) of them."""
    index = np.flatnonzero(patch.force > 0)
    if len(index) <= most:
        return index
    place = patch.points[index, :2]
    away = ((place - place.mean(axis=0)) ** 2).sum(axis=1)
    return np.sort(index[np.argsort(away, kind="stable")[:most]])


def _largest(approach: np.ndarray, compliance: np.ndarray) -> float:
    """mu of the symmetric parts (n, n); infinite where the compliance is none."""
    last = [len(approach) - 1] * 2
    symmetric = [(matrix + matrix.T) / 2 for matrix in (approach, compliance)]
    try:
        return float(linalg.eigh(*symmetric, eigvals_only=True, subset_by_index=last)[0])
    except np.linalg.LinAlgError:  # not positive definite: nothing gives way at once
        return math.inf


def _steps(mu: float) -> float:
    """Steps a period of the oscillation of that mu."""
    if mu <= 0.0:
        return math.inf
    # cos a = (1 - 4 mu) / (1 + 2 mu) for the angle a of a step, by its half: a cosine of 1 says nothing of a small one.
    half = 3 * mu / (1 + 2 * mu) if math.isfinite(mu) else 1.0
    return math.pi / math.asin(math.sqrt(min(half, 1.0)))


def warning(share: float) -> str:
    """What to say of a share of points that open and close."""
    return (
        f"contact: {100 * share:.2g} % of the points that touch open and close from step to step: take a smaller "
        'time.step, or time.scheme = "constant"'
    )


class Alternation:
    """How many of the points that touch change back in every step, counted as the loop goes.

    An event is a point that touches or not as two steps before, and not as in the step between. `worst`
    is the largest share of events in the points that touch, of all windows of `WINDOW` steps.
    """

    def __init__(self) -> None:
        self.worst = 0.0
        self._last = np.zeros((0, 0), dtype=bool)
        self._window = np.zeros(3, dtype=np.int64)  # steps, events, points that touch

    def add(self, force: np.ndarray) -> None:
        """Count n steps: forces (n, c) N."""
        active = force > 0
        rows = np.concatenate([self._last.reshape(-1, active.shape[1]), active])
        back = (rows[2:] == rows[:-2]) & (rows[2:] != rows[1:-1])
        events = np.zeros(len(active), dtype=np.int64)
        events[len(active) - len(back) :] = back.sum(axis=1)
        # Windows begin at the first step: they do not depend on how the steps are blocked.
        for now in zip(events.tolist(), active.sum(axis=1).tolist(), strict=True):
            self._window += (1, *now)
            if self._window[0] == WINDOW:
                self._close()
        self._last = rows[-2:]

    def finish(self) -> None:
        """Count the window that the end of the loop cuts short, unless it is too short to say anything."""
        if self._window[0] >= WINDOW // 4:
            self._close()

    def _close(self) -> None:
        steps, back, touching = self._window.tolist()
        self.worst = max(self.worst, back / max(touching, steps))
        self._window[:] = 0

    def check(self, limit: float) -> None:
        """Chatter where more than this share of the points change back."""
        if self.worst > limit:
            raise Chatter(warning(self.worst), self.worst)

    def state(self) -> dict[str, np.ndarray]:
        """What a checkpoint keeps."""
        return {
            "alternation": np.array(self.worst),
            "alternation_window": self._window,
            "alternation_last": self._last,
        }

    def set_state(self, kept: dict[str, np.ndarray]) -> None:
        """Go on from `state`."""
        self.worst = float(kept["alternation"])
        self._window, self._last = kept["alternation_window"].copy(), kept["alternation_last"]
