"""Sound of a vibrating closed surface over a road, by boundary elements and reciprocity.

With e^{+iwt}, k = w/c and the image x' of x in the road z = 0,

    G(x, y) = e^{-ikr} / (4 pi r) + e^{-ikr'} / (4 pi r'),    r = |x - y|,  r' = |x - y'|.

For each microphone m the rigid body is solved in the field of a point source there (Burton and
Miller, Proc. R. Soc. A 323 (1971) 201; n into the air),

    [1/2 - D - alpha H] g = G(., x_m) + alpha dG(., x_m)/dn,
    D g = int g dG/dn_y,   H g = d/dn_x int g dG/dn_y,

and by reciprocity the pressure of the normal velocity v is  p(x_m) = i w rho int g v dS. All
microphones are right-hand sides of one factorisation, and one more velocity costs a product.

Elements are constant, with collocation at their centroids. The parts of the kernels that are
singular at k = 0 are integrated in closed form over near elements and over near images, so that thin
gaps between body and road need no small elements; the rest by Gauss points. The diagonal follows
from the identities of a closed surface, sum_j D_ij = -1/2 and sum_j H_ij = 0 at k = 0. Below the
first frequency at which the body's inside could resonate alpha = 0, which is more accurate; above
it alpha = -i / max(k, 25 1/m). Elements that lie on the road are left out: body and image are closed
without them.

Over a road that absorbs the images have the correction of greens.absorbing_road beside them, whose
singular part, that of 2 i k b e^{-ikr'} / (4 pi r') in dC/dz, is integrated in closed form too.

Of smooth bodies the pressure is within some 0.5 dB where the longest edge is a tenth of the wave
length, 1 dB at 1/6.5; beyond a third of it the elements are refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, linalg

from tireroad.fem.errors import InputError
from tireroad.greens.absorbing_road import AbsorbingPlane, Tabulated

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Single = NDArray[np.complex64]

ON_ROAD = 1e-6  # of the body's size: nodes this near to the road lie on it
NEAR = 3.0  # element radii: nearer than that an element is integrated in closed form
BLOCK = 400_000  # pairs of points at a time
COUPLING = 25.0  # 1/m: least k of the coupling -i/k, which else dominates at low frequencies
SAFE = 0.98  # of the lowest possible resonance inside, below which no coupling is needed
PER_WAVE = 3.0  # longest edges on a wave length, at least
APART = 60.0  # Hz between solved frequencies where many are asked for: 0.02 dB
MIRROR = np.array([1.0, 1.0, -1.0])
AWAY = 1e20  # m2: square of the distance given to pairs that are integrated otherwise
CLOSED = 2e-4  # of the area: what the vector areas of a closed surface may add up to


def radiate(
    points: Array,
    quads: NDArray[np.intp],
    normal_velocity: Complex,
    frequency: Array,
    microphones: Array,
    *,
    road: bool = True,
    speed_of_sound: float = 343.0,
    density: float = 1.2,
    impedance: Complex | None = None,
) -> Complex:
    """Pressure (k, f) Pa at `microphones` (k, 3) m of a vibrating closed surface. Not collective.

    `points` (n, 3) m, with the `road` at z = 0; `quads` (m, 4) of them, outward, triangles with
    a repeated node; `normal_velocity` (m, f) m/s of each element into the air at each `frequency`
    (f,) Hz. Complex amplitudes for e^{+iwt}. `speed_of_sound` m/s and `density` kg/m3 of the air.
    `impedance` (f,): the road's surface impedance over that of air, rho c, at each frequency, with a
    negative imaginary part where the road is a spring; it reacts locally. None, or infinite, is rigid.
    With it, every frequency is solved by itself. InputError for a surface that is open, faces
    inwards or reaches under the road, for microphones inside it, under the road or nearer to an
    element than its size, for frequencies that are not positive or whose waves are shorter than three
    edges, and for an impedance that is 0 or has a negative real part.
    """
    body = SoundBody.of(points, quads, road)
    velocity = np.atleast_2d(np.asarray(normal_velocity, complex))
    hertz = np.atleast_1d(np.asarray(frequency, float))
    listeners = np.atleast_2d(np.asarray(microphones, float))
    if velocity.shape != (len(quads), len(hertz)):
        raise InputError(
            f"radiate: normal_velocity has shape {velocity.shape}; {len(quads)} elements and "
            f"{len(hertz)} frequencies require {(len(quads), len(hertz))}"
        )
    if not (np.isfinite(velocity).all() and speed_of_sound > 0 and density > 0):
        raise InputError("radiate: velocities must be finite, speed_of_sound and density positive")
    body.check_frequencies(hertz, speed_of_sound)
    body.check_microphones(listeners)
    if impedance is None:
        g = transfer(body, hertz, listeners, speed_of_sound)
    else:
        waves = 2 * np.pi * hertz / speed_of_sound
        admittance = _admittance(impedance, len(hertz), road)
        g = np.stack([body.solve(k, listeners, b) for k, b in zip(waves, admittance, strict=True)])
    moved = velocity[body.kept] * body.area[:, None]
    return 2j * np.pi * hertz * density * np.einsum("fjk,jf->kf", g, moved)


def _admittance(impedance: Complex, count: int, road: bool) -> Complex:
    """Admittances (f,) of the road over that of air; InputError for what no road has."""
    impedances = np.atleast_1d(np.asarray(impedance, complex))
    if not road:
        raise InputError("radiate: impedance is that of the road: road = False has none")
    if impedances.shape != (count,):
        raise InputError(
            f"radiate: impedance has shape {impedances.shape}; {count} frequencies require {(count,)}"
        )
    if np.isnan(impedances).any() or (impedances == 0).any() or (impedances.real < 0).any():
        raise InputError(
            "radiate: impedance must be a number other than 0 whose real part is not negative (e^{+iwt}; a soft "
            "road has a small one)"
        )
    rigid = np.isinf(impedances)
    return np.where(rigid, 0.0, 1 / np.where(rigid, 1.0, impedances))


def transfer(
    body: SoundBody, frequency: Array, microphones: Array, speed_of_sound: float
) -> Complex:
    """g (f, e, k) 1/m of the e elements for the microphones (k, 3), at frequencies (f,) Hz.

    Where more are asked for than one in `APART` Hz, g is solved that far apart and interpolated by
    a cubic spline of g e^{ikR}, R from the microphone to the body.
    """
    every, wave = np.unique(frequency), 2 * np.pi / speed_of_sound
    few = max(int(np.ceil(np.ptp(every) / APART)) + 1, 4)
    solved = every if len(every) <= few + 1 else np.linspace(every[0], every[-1], few)
    pressures = np.stack([body.solve(wave * f, microphones) for f in solved])
    if solved is every:
        return pressures[np.searchsorted(solved, frequency)]
    apart = np.linalg.norm(microphones - body.center.mean(axis=0), axis=1)
    ahead = np.exp(1j * wave * solved[:, None] * apart)[:, None]
    smooth = interpolate.CubicSpline(solved, pressures * ahead)(frequency)
    return smooth * np.exp(-1j * wave * frequency[:, None] * apart)[:, None]


@dataclass(frozen=True)
class SoundBody:
    """A closed surface of e quadrilaterals with `corners` (e, 4, 3) m, over a `road` or in free air.

    `kept` (e,): their numbers among the elements given, of which those on the road are left out.
    """

    corners: Array
    kept: NDArray[np.intp]
    road: bool

    @staticmethod
    def of(points: Array, quads: NDArray[np.intp], road: bool) -> SoundBody:
        """The body of `radiate`; InputError where it is not closed or faces inwards."""
        points, quads = np.asarray(points, float), np.asarray(quads)
        if points.ndim != 2 or points.shape[1] != 3 or quads.ndim != 2 or quads.shape[1] != 4:
            raise InputError("radiate: points are (n, 3) and quads (m, 4)")
        if not np.isfinite(points).all() or quads.min() < 0 or quads.max() >= len(points):
            raise InputError("radiate: points must be finite, and quads name points from 0 on")
        corners = points[quads]
        size = float(np.ptp(points[np.unique(quads)], axis=0).max())
        if not road:
            body = SoundBody(corners, np.arange(len(quads)), False)
        else:
            if corners[..., 2].min() < -ON_ROAD * size:
                raise InputError(
                    f"radiate: the surface reaches {-1e3 * corners[..., 2].min():.3g} mm under the "
                    "road at z = 0: move it up, or take road = False"
                )
            lies = (corners[..., 2] <= ON_ROAD * size).all(axis=1)
            body = SoundBody(corners[~lies], np.flatnonzero(~lies), True)
        return body.checked("radiate")

    def checked(self, owner: str) -> SoundBody:
        """The body itself; InputError, which names the `owner`, where it is not closed or faces inwards."""
        size = float(np.ptp(self.corners, axis=(0, 1)).max())
        if not (self.area > 1e-12 * size**2).all():
            raise InputError(f"{owner}: an element has no area")
        open_to = self.vector.sum(axis=0)
        if self.road and self.corners[..., 2].min() <= ON_ROAD * size:
            open_to[2] = 0.0  # the contact
        if np.linalg.norm(open_to) > CLOSED * self.area.sum():
            raise InputError(
                f"{owner}: the surface is not closed: its areas add up to {1e4 * np.linalg.norm(open_to):.3g} cm2; "
                "close its holes, as those of a wheel by discs"
            )
        worst = float(np.abs(self.defect).max())
        if worst > 0.25:
            raise InputError(
                f"{owner}: the surface is not closed, or faces inwards: the solid angles seen from "
                f"element {int(self.kept[np.abs(self.defect).argmax()])} are off by {worst:.2g} of a "
                "sphere's half: close it, with corners in the order that turns counterclockwise from outside"
            )
        return self

    @cached_property
    def center(self) -> Array:
        """Collocation points (e, 3) m: the means of the distinct corners."""
        c = self.corners
        triangle = (np.linalg.norm(c - np.roll(c, -1, axis=1), axis=2) == 0).sum(axis=1) == 1
        mean = c.mean(axis=1)
        for j in np.flatnonzero(triangle):
            mean[j] = np.unique(c[j], axis=0).mean(axis=0)
        return mean

    @cached_property
    def vector(self) -> Array:
        """Vector areas (e, 3) m2, half the cross product of the diagonals."""
        c = self.corners
        return np.asarray(np.cross(c[:, 2] - c[:, 0], c[:, 3] - c[:, 1]) / 2, float)

    @cached_property
    def area(self) -> Array:
        """Areas (e,) m2."""
        return np.linalg.norm(self.vector, axis=1)

    @cached_property
    def normal(self) -> Array:
        """Unit normals (e, 3), into the air."""
        return self.vector / self.area[:, None]

    @cached_property
    def radius(self) -> Array:
        """Largest distance (e,) m of a corner from the centroid."""
        return np.linalg.norm(self.corners - self.center[:, None], axis=2).max(axis=1)

    @cached_property
    def edge(self) -> float:
        """The longest edge, m."""
        c = self.corners
        return float(np.linalg.norm(c - np.roll(c, -1, axis=1), axis=2).max())

    def check_frequencies(self, frequency: Array, speed_of_sound: float) -> None:
        """InputError for frequencies (f,) Hz that the elements cannot follow."""
        if not (np.isfinite(frequency).all() and (frequency > 0).all()):
            raise InputError("radiate: frequencies must be positive and finite")
        most = speed_of_sound / (PER_WAVE * self.edge)
        if frequency.max() > most:
            raise InputError(
                f"radiate: {frequency.max():.4g} Hz is beyond these elements, whose longest edge of "
                f"{1e3 * self.edge:.3g} mm follows waves to {most:.4g} Hz: take smaller elements"
            )

    def check_microphones(
        self, place: Array, owner: str = "radiate", names: Sequence[str] = ()
    ) -> None:
        """InputError for microphones (k, 3) m inside, under the road or on the surface."""
        if place.shape[1] != 3 or not np.isfinite(place).all():
            raise InputError(f"{owner}: microphones are (k, 3), finite")
        for k, x in enumerate(place):
            who = f"{owner}: microphone {names[k] if names else k}"
            if self.road and x[2] < 0:
                raise InputError(f"{who} lies under the road: z = {x[2]:.3g} m")
            near = np.linalg.norm(self.center - x, axis=1) - self.radius
            if near.min() < 0:
                raise InputError(
                    f"{who} is nearer to element {int(self.kept[near.argmin()])} than its "
                    f"size of {2e3 * self.radius[near.argmin()]:.3g} mm: move it away, or take smaller elements"
                )
            angles = [solid_angles(np.tile(x, (len(c), 1)), c).sum() for c in self._bodies]
            if abs(sum(angles)) > 2 * np.pi:
                raise InputError(f"{who} lies inside the body")

    @property
    def _bodies(self) -> list[Array]:
        """Corners of the elements and, over a road, of their images, outward (e, 4, 3)."""
        own = self.corners
        return [own, (own * MIRROR)[:, ::-1]] if self.road else [own]

    def resonance(self, speed_of_sound: float = 1.0) -> float:
        """A frequency (Hz) below which nothing inside can resonate with pressure zero all around.

        The higher one of that of a box around the body and of a ball of its volume (Faber and
        Krahn). A body that stands on the road is open to its image, and both count.
        """
        low, high = self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))
        size, volume = high - low, float((self.center * self.vector).sum()) / 3
        if self.road and low[2] <= ON_ROAD * size.max():
            size[2], volume = 2 * size[2], 2 * volume
        box = 0.5 * float(np.sqrt((size**-2.0).sum()))
        return speed_of_sound * max(box, 0.5 / (3 * volume / (4 * np.pi)) ** (1 / 3))

    def points_and_weights(self, count: int) -> tuple[Array, Array]:
        """Points (e, q, 3) m and vector weights (e, q, 3) m2 of count x count points an element."""
        at, weight = np.polynomial.legendre.leggauss(count)
        s, t = (a.ravel() for a in np.meshgrid(at, at))
        shape = np.stack(
            [(1 - s) * (1 - t), (1 + s) * (1 - t), (1 + s) * (1 + t), (1 - s) * (1 + t)]
        )
        by_s = np.stack([-(1 - t), 1 - t, 1 + t, -(1 + t)])
        by_t = np.stack([-(1 - s), -(1 + s), 1 + s, 1 - s])
        place, along, across = (
            np.einsum("aq,eac->eqc", part / 4, self.corners) for part in (shape, by_s, by_t)
        )
        return place, np.cross(along, across) * np.outer(weight, weight).ravel()[:, None]

    @cached_property
    def _near(self) -> tuple[list[NDArray[np.intp]], list[NDArray[np.intp]]]:
        """Pairs of collocation points and near elements, or near images: rows and columns."""
        rows, columns = [], []
        for mirror in self._mirrors:
            apart = np.linalg.norm(self.center[:, None] - self.center * mirror, axis=2)
            i, j = np.nonzero(apart < NEAR * self.radius + self.radius)
            rows.append(i)
            columns.append(j)
        return rows, columns

    @property
    def _mirrors(self) -> list[Array]:
        return [np.ones(3), MIRROR] if self.road else [np.ones(3)]

    @cached_property
    def _closed(self) -> list[tuple[Array, Array, Array]]:
        """D, H and S at k = 0 of the near pairs, in closed form; D and H of an element on itself 0."""
        faces: list[tuple[Array, Array, Array]] = []
        for corners, i, j in zip(self._bodies, *self._near, strict=True):
            x, n, c = self.center[i], self.normal[i], corners[j]
            double = -solid_angles(x, c) / (4 * np.pi)
            hyper = -(n * edge_field(x, c)).sum(axis=1) / (4 * np.pi)
            if not faces:
                double[i == j] = hyper[i == j] = 0.0
            faces.append((double, hyper, potentials(x, c) / (4 * np.pi)))
        return faces

    @cached_property
    def _static(self) -> tuple[Array, Array]:
        """Row sums (e,) of D and H at k = 0 over all elements and images but each on itself."""
        sums = np.zeros((2, len(self.area)))
        for rows, double, hyper in self._far(0.0, True):
            sums[0, rows], sums[1, rows] = double.real.sum(axis=1), hyper.real.sum(axis=1)
        for closed, i in zip(self._closed, self._near[0], strict=True):
            np.add.at(sums[0], i, closed[0])
            np.add.at(sums[1], i, closed[1])
        return sums[0], sums[1]

    @cached_property
    def defect(self) -> Array:
        """Defect of the row sums of D from -1/2, (e,): small for a closed surface."""
        return -0.5 - self._static[0]

    def _far(self, k: float, hyper: bool) -> Iterator[tuple[slice, Single, Single]]:
        """Blocks of rows of D and, if wanted, H over all pairs that are not near; those are 0.

        Distances and their products with normals by products of matrices, in single precision,
        about the body's middle.
        """
        place, weight = self.points_and_weights(2)
        e, q = place.shape[:2]
        middle = self.center.mean(axis=0)
        wave, size = np.float32(k), max(BLOCK // (e * q), 1)
        for first in range(0, e, size):
            rows = slice(first, min(first + size, e))
            count = rows.stop - first
            n = self.normal[rows].astype(np.float32)
            double = np.zeros((count, e), np.complex64)
            second = np.zeros_like(double)

            def total(values: NDArray[np.float32], count: int = count) -> NDArray[np.float32]:
                """The sum over an element's points."""
                return values.reshape(count, q, e).sum(axis=1)

            for mirror, i, j in zip(self._mirrors, *self._near, strict=True):
                # Both relative to a point that lies near both where they are near each other.
                about = middle if mirror[2] > 0 else middle * [1, 1, 0]
                y = np.swapaxes(place * mirror - about, 0, 1).reshape(-1, 3).astype(np.float32)
                w = np.swapaxes(weight * mirror, 0, 1).reshape(-1, 3).astype(np.float32)
                x = (self.center[rows] - about).astype(np.float32)
                square = x @ (-2 * y.T)
                square += (x * x).sum(axis=1)[:, None]
                square += (y * y).sum(axis=1)
                own = (i >= rows.start) & (i < rows.stop)
                near = square.reshape(count, q, e)
                near[i[own] - rows.start, :, j[own]] = AWAY
                r = np.sqrt(square, out=square)
                part = 1 / r
                b = (y * w).sum(axis=1) - x @ w.T
                b *= part
                z = wave * r
                cos, sin = np.cos(z), np.sin(z)
                scale = part / np.float32(4 * np.pi)
                cos *= scale
                sin *= scale
                double.real -= total((part * cos + wave * sin) * b)
                double.imag -= total((wave * cos - part * sin) * b)
                if hyper:
                    b *= ((n * x).sum(axis=1)[:, None] - n @ y.T) * part
                    both = (n @ w.T) * part
                    real = (3 * part**2 - wave**2) * b + part * both
                    imaginary = wave * (3 * part * b + both)
                    second.real += total(real * cos + imaginary * sin)
                    second.imag += total(imaginary * cos - real * sin)
            yield rows, double, second

    @cached_property
    def _around(self) -> list[tuple[Array, ...]]:
        """Geometry of the near pairs (p,) at 4 x 4 points: r, a, b and c (16, p) of `_smooth`, and n.n' (p,)."""
        place, weight = self.points_and_weights(4)
        strips: list[tuple[Array, ...]] = []
        for mirror, i, j in zip(self._mirrors, *self._near, strict=True):
            x, n = self.center[i], self.normal[i]
            d = np.moveaxis((place * mirror)[j], 1, 0) - x
            w = np.moveaxis((weight * mirror)[j], 1, 0)
            r = np.linalg.norm(d, axis=2)
            a, b = -(d * n).sum(axis=2) / r, (d * w).sum(axis=2) / r
            turned = (n * (self.normal * mirror)[j]).sum(axis=1)
            strips.append((r, a, b, (w * n).sum(axis=2), turned))
        return strips

    def _smooth(self, k: float, hyper: bool) -> list[tuple[Complex, Complex]]:
        """Smooth parts of D and, if wanted, H of the near pairs: their differences from k = 0."""
        corners = []
        for (r, a, b, c, turned), closed in zip(self._around, self._closed, strict=True):
            z = k * r
            wave = np.cos(z) - 1j * np.sin(z)
            double = -((1j * z + 1) * wave - 1) * b / (4 * np.pi * r**2)
            second = np.zeros((1, len(turned)), complex)
            if hyper:
                second = ((3 + 3j * z - z**2) * wave - 3) * (a * b)
                second += ((1 + 1j * z) * wave - 1 - z**2 / 2) * c
                second /= 4 * np.pi * r**3
            more = turned * k**2 / 2 * closed[2]
            corners.append((double.sum(axis=0), second.sum(axis=0) + more))
        return corners

    def _absorbed(self, table: Tabulated, hyper: bool) -> Iterator[tuple[slice, Single, Single]]:
        """Blocks of rows of what C adds to D and, if wanted, H, of pairs whose images are not near."""
        place, weight = self.points_and_weights(2)
        e, q = place.shape[:2]
        about = self.center.mean(axis=0) * [1, 1, 0]
        y = np.swapaxes(place * MIRROR - about, 0, 1).reshape(-1, 3).astype(np.float32)
        w = np.swapaxes(weight, 0, 1).reshape(-1, 3).astype(np.float32)
        i, j = self._near[0][1], self._near[1][1]
        size = max(BLOCK // (e * q), 1)
        for first in range(0, e, size):
            rows = slice(first, min(first + size, e))
            x = (self.center[rows] - about).astype(np.float32)
            n = self.normal[rows].astype(np.float32)
            square = x @ (-2 * y.T)
            square += (x * x).sum(axis=1)[:, None]
            square += (y * y).sum(axis=1)
            heights = x[:, 2:] - y[:, 2]
            apart = np.sqrt(np.maximum(square, heights**2))
            ahead = (y[:, :2] * w[:, :2]).sum(axis=1) - x[:, :2] @ w[:, :2].T
            normal = None
            if hyper:
                along = n[:, :2] @ y[:, :2].T - (n[:, :2] * x[:, :2]).sum(axis=1)[:, None]
                normal = along, n[:, 2:], n[:, :2] @ w[:, :2].T
            absorbed = table.at(apart, heights)
            parts = table.plane.kernels(absorbed, (apart, heights), (ahead, w[:, 2]), normal)
            own = (i >= rows.start) & (i < rows.stop)
            out = []
            for part in parts if hyper else parts[:1]:
                total = part.reshape(len(x), q, e).sum(axis=1)
                total[i[own] - rows.start, j[own]] = 0
                out.append(total)
            yield rows, out[0], out[-1]

    def _absorbed_near(self, table: Tabulated, hyper: bool) -> tuple[Complex, Complex]:
        """Parts of D and, if wanted, H, that C adds at the pairs (p,) whose images are near."""
        place, weight = self.points_and_weights(4)
        i, j = self._near[0][1], self._near[1][1]
        x, n = self.center[i], self.normal[i]
        y, w = np.moveaxis(place[j], 1, 0), np.moveaxis(weight[j], 1, 0)
        d, heights = (y - x)[..., :2], (y + x)[..., 2]
        apart, up = np.hypot(np.linalg.norm(d, axis=2), heights), w[..., 2]
        ahead = (d * w[..., :2]).sum(axis=2)
        normal = None
        if hyper:
            normal = (d * n[:, :2]).sum(axis=2), n[:, 2], (w[..., :2] * n[:, :2]).sum(axis=2)
        absorbed = table.at(apart.astype(np.float32), heights.astype(np.float32))
        values = absorbed[0].astype(complex), absorbed[1].astype(complex)
        parts = table.plane.kernels(values, (apart, heights), (ahead, up), normal)
        # What is singular in them, and its integral in closed form.
        turn = 2j * table.plane.k * table.plane.admittance
        closed, rise = self._closed[1], self.normal[j, 2]
        single = np.linalg.norm(w, axis=2) * rise / (4 * np.pi * apart)
        double = (parts[0] - turn * single).sum(axis=0) + turn * rise * closed[2]
        if not hyper:
            return double, np.zeros(1, complex)
        static = -(up * heights + ahead) / (4 * np.pi * apart**3) * n[:, 2]
        second = (parts[1] - turn * static).sum(axis=0) + turn * n[:, 2] * closed[0]
        return double, second

    def solve(self, k: float, microphones: Array, admittance: complex = 0.0) -> Complex:
        """g (e, m) 1/m at the wave number `k` (1/m) for the microphones (m, 3) m.

        `admittance` of the road: rho c over its impedance, e^{+iwt}; 0 of a rigid one.
        """
        plane = AbsorbingPlane(k, complex(admittance)) if k and admittance else None
        alpha = 0.0 if k < 2 * np.pi * SAFE * self.resonance() else -1j / max(k, COUPLING)
        e = len(self.area)
        matrix = np.zeros((e, e), np.complex64)
        for rows, double, hyper in self._far(k, alpha != 0):
            matrix[rows] = -double - np.complex64(alpha) * hyper
        for closed, more, i, j in zip(
            self._closed, self._smooth(k, alpha != 0), *self._near, strict=True
        ):
            part = -(closed[0] + more[0]) - alpha * (closed[1] + more[1])
            np.add.at(matrix, (i, j), part.astype(np.complex64))
        if plane:
            farthest = float(np.linalg.norm(np.ptp(self.corners, axis=(0, 1))[:2]))
            table = plane.tabulated(float(np.hypot(farthest, 2 * self.corners[..., 2].max())))
            for rows, double, hyper in self._absorbed(table, alpha != 0):
                matrix[rows] -= double + np.complex64(alpha) * hyper
            near = self._absorbed_near(table, alpha != 0)
            part = -near[0] - alpha * near[1]
            np.add.at(matrix, (self._near[0][1], self._near[1][1]), part.astype(np.complex64))
        own = np.arange(e)
        matrix[own, own] += (0.5 - self.defect + alpha * self._static[1]).astype(np.complex64)
        right = np.zeros((e, len(microphones)), complex)
        for mirror in self._mirrors:
            d = microphones * mirror - self.center[:, None]
            r = np.linalg.norm(d, axis=2)
            wave = np.exp(-1j * k * r) / (4 * np.pi * r)
            slope = (d * self.normal[:, None]).sum(axis=2) / r * (1j * k + 1 / r) * wave
            right += wave + alpha * slope
        if plane:
            for m, place in enumerate(microphones):
                c, rise = plane.source(self.center, place)
                right[:, m] += c + alpha * (rise * self.normal).sum(axis=1)
        factor = linalg.lu_factor(matrix, overwrite_a=True, check_finite=False)
        return linalg.lu_solve(factor, right.astype(np.complex64), check_finite=False)


def solid_angles(x: Array, corners: Array) -> Array:
    """Solid angles (p,) of quadrilaterals (p, 4, 3) seen from x (p, 3), of two triangles each.

    Positive where the normal points away from x. Van Oosterom and Strackee, IEEE Trans. Biomed.
    Eng. 30 (1983) 125.
    """
    a, b, c, d = np.moveaxis(corners - x[:, None], 1, 0)
    return _triangle(a, b, c) + _triangle(a, c, d)


def _triangle(a: Array, b: Array, c: Array) -> Array:
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=1)
    below = la * lb * lc + (a * b).sum(axis=1) * lc
    below += (b * c).sum(axis=1) * la + (c * a).sum(axis=1) * lb
    return 2 * np.arctan2(volume, below)


def edge_field(x: Array, corners: Array) -> Array:
    """Integrals (p, 3) of the law of Biot and Savart around quadrilaterals (p, 4, 3), at x (p, 3)."""
    out = np.zeros_like(x)
    for k in range(4):
        a, b = corners[:, k] - x, corners[:, (k + 1) % 4] - x
        la, lb = np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)
        below = la * lb * (la * lb + (a * b).sum(axis=1))
        cross = np.cross(a, b) * (la + lb)[:, None]
        out += np.where(below[:, None] > 0, cross / np.where(below > 0, below, 1.0)[:, None], 0.0)
    return out


def potentials(x: Array, corners: Array) -> Array:
    """int 1/r (p,) m over quadrilaterals (p, 4, 3) from x (p, 3), two triangles each.

    Wilton and others, IEEE Trans. Antennas Propag. 32 (1984) 276.
    """
    return _potential(x, corners[:, [0, 1, 2]]) + _potential(x, corners[:, [0, 2, 3]])


def _potential(x: Array, corners: Array) -> Array:
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1)
    flat = size > 0
    normal = normal / np.where(flat, size, 1.0)[:, None]
    h = ((x - corners[:, 0]) * normal).sum(axis=1)
    out = np.zeros(len(x))
    for k in range(3):
        a, b = corners[:, k], corners[:, (k + 1) % 3]
        along = b - a
        length = np.linalg.norm(along, axis=1)
        along = along / np.where(length > 0, length, 1.0)[:, None]
        outward = np.cross(along, normal)
        t = ((a - x) * outward).sum(axis=1)
        low, high = ((a - x) * along).sum(axis=1), ((b - x) * along).sum(axis=1)
        near, far = np.linalg.norm(a - x, axis=1), np.linalg.norm(b - x, axis=1)
        root = t**2 + h**2
        # From the end whose sum does not cancel.
        forward = low + high >= 0
        top = np.where(forward, far + high, near - low)
        below = np.where(forward, near + low, far - high)
        ratio = np.where((top > 0) & (below > 0), top / np.where(below > 0, below, 1.0), 1.0)
        part = t * np.log(ratio)
        part -= np.abs(h) * (
            np.arctan2(t * high, root + np.abs(h) * far)
            - np.arctan2(t * low, root + np.abs(h) * near)
        )
        out += np.where(length > 0, part, 0.0)
    return np.where(flat, out, 0.0)
