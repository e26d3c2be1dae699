"""Names of modes and rolling states, by their Fourier series around the outer face.

    u(theta, s) = sum_n c_n(s) e^{i n theta},   share of n = (|c_n|^2 + |c_-n|^2) / sum |c|^2,

integrated over the face, u in tangential, axial and radial components and theta from the lowest
point towards +x. The fields are those of the elements: between the nodes by their own shape.

A name has a letter and the circumferential wave number n: R moves in the plane of the wheel (a field
symmetric in y), L out of it (antisymmetric), T turns about the axle; R0 breathes, R1 shifts the belt
up or fore and aft, L0 sideways, L1 tilts it (yaw, camber). These are the lowest of their n and
symmetry. The others are [n,a], a being the number of nodal lines along the tread: even if symmetric.
C is air in the cavity. Of the two branches of a rolling tire "+" travels with the rotation, "-"
against it. Where no n holds half of a mode, the second is added: R7/6.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from tireroad.fem.sections import mesh2d
from tireroad.fem.tire.mesh import NodeGrid

HALF = 0.5  # least share of the wave number that names a mode alone, or of the air or the wheel
TRAVELS = 1 / 3  # least excess of one direction over the other, of their sum, in a travelling wave
ALONE = 0.8  # above, a state is one of the two branches; below, it may be either of a pair
TREAD = 0.7  # least radial part of the outer face's normal on the tread
_SEEN = 0.1  # of the largest radial motion on the tread: smaller ones have no sign
_MOST = 25  # places along the section at which fields are read: enough for ten nodal lines
_AT_ONCE = 64  # fields
MOTION = {
    "R": "in plane, symmetric",
    "L": "out of plane, antisymmetric",
    "T": "torsional, about the axle",
    "C": "air in the cavity",
}
RIGID = "rigid", "rigid body"
STILL = "overdamped", "does not oscillate"
WHEEL = "wheel", "wheel and body on their springs"
_EVEN = 4  # angles a node, at which the elements' fields are read


@dataclass(frozen=True, kw_only=True)
class ModeNames:
    """Names of m modes or states: `name` and `motion` in words, texts (m,).

    `wave` (m,): the wave number n that holds most of it; `share` (m,): how much; `order` (m,): nodal
    lines along the tread, a; `travel` (m,): from 1, all of it with the rotation, to -1, against it; 0
    for a standing mode.
    """

    name: np.ndarray
    motion: np.ndarray
    wave: np.ndarray
    share: np.ndarray
    order: np.ndarray
    travel: np.ndarray

    def at(self, which: np.ndarray | slice) -> ModeNames:
        """The names of some of the modes, in that order."""
        return ModeNames(**{key: values[which] for key, values in vars(self).items()})


@dataclass(frozen=True, kw_only=True)
class AirWaves:
    """The waves of the air in m states: `mostly` (m,) whether the air holds half of the kinetic energy;
    `wave`, `pure` and `travel` (m,) of its pressure as `wave`, `share` and `travel` of ModeNames.
    """

    mostly: np.ndarray
    wave: np.ndarray
    pure: np.ndarray
    travel: np.ndarray


@dataclass(frozen=True, kw_only=True)
class _Series:
    """Figures of each mode's series, (m,) each; `second`: the wave number with the second largest share,
    `parity`: from 1, symmetric in y, to -1; `turns`: whether the tread moves around the axle alone.
    """

    wave: np.ndarray
    second: np.ndarray
    share: np.ndarray
    travel: np.ndarray
    parity: np.ndarray
    order: np.ndarray
    turns: np.ndarray


class FaceWaves:
    """The Fourier series of fields on the outer face of a tire whose nodes are a `lattice`."""

    def __init__(self, lattice: NodeGrid) -> None:
        around, along = lattice.face_shape
        self._shape = around, along, 3
        line = lattice.section[lattice.tire.section.chain(lattice.tire.section.outer)]
        self._some = np.unique(np.linspace(0, along - 1, min(along, _MOST)).round().astype(int))
        place = line[self._some]
        tangent = np.gradient(place, axis=0)
        length = np.linalg.norm(tangent, axis=1)
        self._area = length * place[:, 0]
        radial = np.abs(tangent[:, 1]) / length
        self._tread = radial >= min(TREAD, float(radial.max()))
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1))])
        unit = np.eye(len(way))
        self._mirror = np.stack([np.interp(way[-1] - way, way, one) for one in unit], axis=1)
        self.highest = max(around // 2 - 1, 0)  # as many as the nodes around tell apart
        number = np.arange(self.highest + 1)
        self._weights = _weights(lattice, np.concatenate([number, -number[1:]]))

    def read(self, shape: np.ndarray) -> np.ndarray:
        """Fields (a, p, 3, m) at `a` nodes around and p places of the section, of shapes (3 s or more, m)."""
        face = shape[: np.prod(self._shape)]
        return face.reshape(*self._shape, -1)[:, self._some]

    def named(
        self,
        fields: np.ndarray,
        known_names: Mapping[int, tuple[str, str]],
        air: AirWaves | None = None,
    ) -> ModeNames:
        """Names of `fields` (a, p, 3, m), real or complex (`read`), ascending in frequency.

        `known_names`: name and motion of those that are named otherwise, by their index. Not collective.
        """
        series = self._series(fields)
        symmetric = series.parity > 0
        order = series.order + (series.order % 2 == symmetric)
        order[series.turns] = 0
        wave, share, travel = series.wave.copy(), series.share.copy(), series.travel.copy()
        letter = np.where(series.turns, "T", np.where(symmetric, "R", "L"))
        if air is not None:
            letter[air.mostly] = "C"
            for values, of_air in ((wave, air.wave), (share, air.pure), (travel, air.travel)):
                values[air.mostly] = of_air[air.mostly]
        way = np.where(travel > TRAVELS, "+", np.where(travel < -TRAVELS, "-", ""))
        before: Counter[tuple[str, ...]] = Counter()
        named = []
        for k, n in enumerate(wave):
            if k in known_names:
                named.append(known_names[k])
                continue
            letter_here, a = str(letter[k]), int(order[k])
            group, mixed = (
                (letter_here, str(n), str(way[k])),
                share[k] < HALF and letter_here != "C",
            )
            before[group] += not mixed
            pair = n and abs(travel[k]) < ALONE  # both can lean the same way on a loaded tire
            lowest = before[group] <= (2 if pair else 1) and a == (letter_here == "L")
            text = f"{letter_here}{n}" if lowest or letter_here in "TC" else f"[{n},{a}]"
            if mixed:
                text += f"/{series.second[k]}"
            named.append((text + way[k], MOTION[letter_here]))
        return ModeNames(
            name=np.array([name for name, _ in named], dtype=object),
            motion=np.array([motion for _, motion in named], dtype=object),
            wave=wave,
            share=share,
            order=order,
            travel=travel,
        )

    def _series(self, fields: np.ndarray) -> _Series:
        starts = range(0, max(fields.shape[-1], 1), _AT_ONCE)
        parts = [vars(self._of_some(fields[..., k : k + _AT_ONCE])) for k in starts]
        return _Series(**{key: np.concatenate([part[key] for part in parts]) for key in parts[0]})

    def coefficients(self, fields: np.ndarray) -> np.ndarray:
        """c_n (k, p, 3, m) of fields (a, p, 3, m): n = 0, 1, ... to `highest`, then -1, -2, ...

        Components tangential, axial, radial.
        """
        x, y, z = np.moveaxis(fields, 2, 0)
        plain, cosine, sine = (partial(np.tensordot, w, axes=1) for w in self._weights)
        return np.stack([cosine(x) + sine(z), plain(y), sine(x) - cosine(z)], axis=2)

    def _of_some(self, fields: np.ndarray) -> _Series:
        amplitude = self.coefficients(fields)
        count, top = fields.shape[-1], self.highest + 1
        power = np.einsum("p,kpcm->km", self._area, np.abs(amplitude) ** 2)
        wave, second, share, travel = _strongest(power[:top], power[top:])
        each = np.arange(count)
        # The profile of the stronger of both directions.
        row = np.where(travel < 0, top + wave - 1, wave)
        profile = amplitude[row, :, :, each]  # (m, p, 3)
        size = np.einsum("p,mpc->mc", self._area, np.abs(profile) ** 2).sum(axis=1)
        other = np.einsum("pq,mqc->mpc", self._mirror, profile) * (1, -1, 1)
        both_sides = np.einsum("p,mpc,mpc->m", self._area, profile.conj(), other).real
        on_tread = np.einsum(
            "p,mpc->mc", self._area[self._tread], np.abs(profile[:, self._tread]) ** 2
        )
        return _Series(
            wave=wave,
            second=second,
            share=share,
            travel=travel,
            parity=both_sides / np.maximum(size, np.finfo(float).tiny),
            order=self._nodal_lines(profile[:, self._tread, 2]),
            turns=(wave == 0) & (on_tread[:, 0] > on_tread[:, 1:].sum(axis=1)),
        )

    @staticmethod
    def _nodal_lines(radial: np.ndarray) -> np.ndarray:
        """Changes of sign (m,) of radial motions (m, p) along the tread, in phase with the largest."""
        lines = np.zeros(len(radial), int)
        for k, row in enumerate(radial):
            largest = row[np.abs(row).argmax()]
            line = (row * largest.conj()).real
            seen = np.sign(line[np.abs(line) > _SEEN * np.abs(largest) ** 2])
            lines[k] = np.count_nonzero(np.diff(seen))
        return lines


def _strongest(
    along: np.ndarray, against: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Wave number with the largest power, with the second largest, share and travel of the first, (m,) each.

    `along` (n + 1, m): power of e^{i n theta} from n = 0 on, which runs towards -theta, as the wheel turns;
    `against` (n, m): of e^{-i n theta} from n = 1 on.
    """
    back = np.zeros_like(along)
    back[1:] = against
    both, least = along + back, np.finfo(float).tiny
    wave, each = both.argmax(axis=0), np.arange(along.shape[1])
    held = np.maximum(both[wave, each], least)
    travel = np.where(wave > 0, (along - back)[wave, each] / held, 0.0)
    share = both[wave, each] / np.maximum(both.sum(axis=0), least)
    both[wave, each] = -1.0
    return wave, both.argmax(axis=0), share, travel


def air_waves(share: np.ndarray, cosine: np.ndarray, sine: np.ndarray) -> AirWaves:
    """The waves of a pressure sum_n cosine_n cos n theta + sine_n sin n theta, (n, m) complex from n = 1 on.

    `share` (m,): of the air in each state's kinetic energy.
    """
    along = np.abs(cosine - 1j * sine) ** 2
    none = np.zeros((1, along.shape[1]))
    wave, _, pure, travel = _strongest(
        np.concatenate([none, along]), np.abs(cosine + 1j * sine) ** 2
    )
    return AirWaves(mostly=share >= HALF, wave=wave, pure=pure, travel=travel)


def _weights(lattice: NodeGrid, number: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights (k, a) of the nodes around for the means of u, u cos theta, u sin theta times e^{-i n theta}.

    u between the nodes as the elements have it.
    """
    corners, order = lattice.ring_corners, len(lattice.edge) - 1
    around = len(lattice.ring)
    angle = 2 * np.pi * np.arange(_EVEN * around) / (_EVEN * around)
    within = corners[0] + (angle - corners[0]) % (2 * np.pi)
    element = np.clip(np.searchsorted(corners, within, side="right") - 1, 0, len(corners) - 2)
    place = (within - corners[element]) / np.diff(corners)[element]
    nodes = (order * element[:, None] + np.arange(order + 1)) % around
    read = np.zeros((len(angle), around))
    np.add.at(read, (np.arange(len(angle))[:, None], nodes), mesh2d.lagrange(lattice.edge, place))
    turned = np.exp(-1j * np.multiply.outer(number, angle)) / len(angle)
    return turned @ read, (turned * np.cos(angle)) @ read, (turned * np.sin(angle)) @ read
