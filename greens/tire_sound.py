"""The tire as a body that sounds: its outer face over the road, closed by the wheel.

The boundary elements of greens.sound on rows and columns of the outer face's nodes in the static
state, as far apart as the waves of the air allow, and on a flat disc at each bead, or on a barrel from
one bead to the other, through which the air can pass. Their g loads
the nodes of the face, which are finer: vibrations that are short against the waves of the air
cancel only there. With g linear around each element's center, from its neighbours,

    g(node) = sum_e N(node, e) g_e,    p = i w rho sum_e g_e U_e,    U = N^T (n A) . v,

where (n A) is the vector area that a node has in the air. v is the rate at a place that does not
move, not of the material: what runs through a shape at rest makes no sound.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import interpolate, sparse

from tireroad.fem.errors import InputError
from tireroad.fem.static.state import StaticState
from tireroad.fem.tire.mesh import ring_quads
from tireroad.greens.absorbing_road import AbsorbingPlane, PorousLayer
from tireroad.greens.outputs import Surface
from tireroad.greens.sound import APART, MIRROR, ON_ROAD, SoundBody

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

WAVES = 8.0  # elements on the shortest wave
LEAST, MOST = 0.020, 0.060  # m: sizes of elements
AHEAD, BESIDE = 0.030, 0.020  # m: at the contact's ends; of the shoulders, whose gap decides
CONTACT = 0.5  # rad around the lowest point: the contact's ends
GAP = 0.020  # m over the road: the shoulders
WHEEL = 1.4  # size of the elements of a disc over that of the others
SAME_SIDE = 0.6  # cosine between the normals of neighbours across no edge
FAR = 20.0  # m: radius of the hemisphere on which the power is taken
ELEVATIONS, AZIMUTHS = 9, 24  # directions of a hemisphere: waves of up to 12 around, exactly


@dataclass(frozen=True, kw_only=True)
class SoundAir:
    """Speed of sound, m/s, and density, kg/m3."""

    speed: float
    density: float

    @staticmethod
    def at(temperature: float) -> SoundAir:
        """Dry air at 1013.25 hPa and a `temperature` in K: 343.2 m/s and 1.204 kg/m3 at 293.15 K."""
        return SoundAir(
            speed=float(np.sqrt(1.4 * 287.05 * temperature)),
            density=101325 / (287.05 * temperature),
        )

    @property
    def impedance(self) -> float:
        """rho c, N s/m3."""
        return self.speed * self.density


def elements_for(frequency: float, air: SoundAir) -> float:
    """Largest size (m) of the elements for sound up to a frequency (Hz)."""
    return float(np.clip(air.speed / (WAVES * frequency), LEAST, MOST))


@dataclass(frozen=True, kw_only=True)
class SoundingTire:
    """The outer face and the wheel as boundary elements over the road at z = 0.

    `body`: e elements; `face` (e,): of the outer face, else of the wheel; `nodes` (s, e): N; `area`
    (s, 3) m2, the vector areas in the air, in the wheel's axes; `axes` (3, 3): rows forward, left
    and up of the road in the wheel's axes, `height` (m) of the axle's centre over it; `grid` (e, 2):
    row and column of the elements of the face, -1 of the wheel; `lines`: the nodes' rows and columns,
    in steps of the face's grid, at which the elements end; `turned`: whether their corners run
    against the order of the grid; `slopes`: of g on the elements of the face (`_slopes`).
    """

    body: SoundBody
    face: NDArray[np.bool_]
    nodes: sparse.csr_matrix
    area: Array
    axes: Array
    height: float
    grid: NDArray[np.intp]
    lines: tuple[Array, Array]
    turned: bool
    slopes: tuple[Array, list[sparse.csr_matrix]]

    @staticmethod
    def of(
        state: StaticState,
        size: float,
        *,
        coarser: float = 1.0,
        wheel: str = "disc",
        wheel_depth: float = 0.0,
        leak: float = 0.0,
    ) -> SoundingTire:
        """The sounding body of a static state on a plane, with elements of at most `coarser` times `size` m.

        `wheel`: "disc", closed on both sides, `wheel_depth` m behind the beads, or "open", a barrel
        between them; `leak` m: height of the contact over the road.
        Whether the body is closed is for `body.checked`.
        """
        if state.road_height is None:
            raise InputError("sound: the tire is not on a road: give [static] a load (N)")
        if state.road.drum_radius is not None:
            raise InputError(
                "sound: the road must be a plane, not a drum: take out road.drum_radius"
            )
        size = coarser * size
        axes, height = road_axes(state)
        place = state.positions @ axes.T
        place[:, 2] += height
        place[:, 2] = np.where(state.force > 0, 0.0, np.maximum(place[:, 2], 0.0))
        place[:, 2] += leak
        level = ON_ROAD * 2 * height
        grid = place.reshape(*state.shape, 3)
        lines = _lines(grid, size, coarser)
        corners, number = _face_elements(grid, lines)
        open_to = (corners[..., 2] > level).any(axis=1)
        right, left = (
            _at(grid, lines[0], np.full(len(lines[0]), c)) for c in (0.0, grid.shape[1] - 1.0)
        )
        disc = WHEEL * size
        if wheel == "open":
            closing = _barrel(left, right, disc)
        else:
            closing = np.concatenate(
                [_disc(left, disc, -wheel_depth), _disc(right, disc, wheel_depth)[:, ::-1]]
            )
        body = SoundBody(
            np.concatenate([corners[open_to], closing]),
            np.arange(open_to.sum() + len(closing)),
            True,
        )
        turned = float((body.center * body.vector).sum()) < 0
        if turned:
            body = replace(body, corners=body.corners[:, ::-1])
        own = np.concatenate([number[open_to], np.full((len(closing), 2), -1)])
        slopes = _slopes(body, own, len(lines[0]))
        quads = ring_quads(*state.shape)
        area = Surface.of(place, quads[(place[quads, 2] > level).any(axis=1)]).normal
        return SoundingTire(
            body=body,
            face=own[:, 0] >= 0,
            nodes=_to_nodes(body, own, lines, place, state.shape, slopes),
            area=(-area if turned else area) @ axes,
            axes=axes,
            height=height,
            grid=own,
            lines=lines,
            turned=turned,
            slopes=slopes,
        )

    def volumes(self, shape: Array, rigid: Array | None = None) -> Array:
        """U (e, m) m2 per unit of m coordinates, which move the face by `shape` (3 s, m) m.

        `rigid` (6, m): how they move the wheel, in m and rad; none (0, m) of a wheel that is held.
        """
        s = len(self.area)
        moved = np.einsum("sc,scm->sm", self.area, shape.reshape(s, 3, -1))
        volumes = np.asarray(self.nodes.T @ moved)
        if rigid is not None and len(rigid):
            some = ~self.face
            place = self.body.center[some] - [0, 0, self.height]
            place, vector = place @ self.axes, self.body.vector[some] @ self.axes
            volumes[some] += np.hstack([vector, np.cross(place, vector)]) @ rigid
        return volumes

    @property
    def outline(self) -> Array:
        """Corners (e, 4, 2) of the elements unrolled: deg around the axle from the lowest point, and
        place from 0 at one bead to 1 at the other; NaN on the wheel."""
        place = (self.body.corners - [0, 0, self.height]) @ self.axes
        angle = np.degrees(np.arctan2(place[..., 0], -place[..., 2]))
        angle = angle[:, :1] + (angle - angle[:, :1] + 180) % 360 - 180
        columns, first = self.lines[1], np.maximum(self.grid[:, 1], 0)
        ends = columns[np.minimum(first[:, None] + [0, 0, 1, 1], len(columns) - 1)] / columns[-1]
        out = np.stack([angle, ends[:, ::-1] if self.turned else ends], axis=-1)
        out[~self.face] = np.nan
        return out

    def inner_sources(self) -> Array:
        """Points (n, 3) m inside: over the ends of the contact, behind the sidewalls and the crown.

        Their fields outside are known exactly, and near enough to the face to vary over an element.
        """
        center, normal = self.body.center, self.body.normal
        deep = float(np.clip(1.2 * np.sqrt(self.body.area[self.face].max()), 0.04, 0.06))
        touch = self.body.corners[..., 2].min(axis=1) <= ON_ROAD * 2 * self.height
        some = np.flatnonzero(self.face)
        rim = some[touch[some]] if touch[some].any() else some[[center[some, 2].argmin()]]
        width, length = np.abs(center[some, 1]).max(), np.abs(center[some, 0]).max()
        goals = [
            center[rim[center[rim, 0].argmax()]],
            center[rim[center[rim, 0].argmin()]],
            np.array([0.0, width, 0.3 * self.height]),
            np.array([0.0, -width, 0.3 * self.height]),
            np.array([0.7 * length, width, self.height]),
            np.array([length, 0.0, self.height]),
        ]
        sources = []
        for goal in goals:
            e = some[np.linalg.norm(center[some] - goal, axis=1).argmin()]
            point = center[e] - deep * normal[e]
            point[2] = max(point[2], deep / 2)
            sources.append(point)
        return np.array(sources)

    def flux_of(self, source: Array, k: float, admittance: complex = 0.0) -> Complex:
        """F (e,): sum_e F_e g_e is minus the integral of g dG/dn of a point source (3,) m inside.

        `admittance` of the road, as in `SoundBody.solve`.
        """
        place, weight = self.body.points_and_weights(4)
        rate = np.zeros(place.shape[:2], complex)
        for mirror in (np.ones(3), MIRROR):
            d = place - source * mirror
            r = np.linalg.norm(d, axis=2)
            rate += (
                (d * weight).sum(axis=2)
                * -(1j * k + 1 / r)
                * np.exp(-1j * k * r)
                / (4 * np.pi * r**2)
            )
        if k and admittance:
            _, rise = AbsorbingPlane(k, admittance).source(place.reshape(-1, 3), source)
            rate += (rise.reshape(place.shape) * weight).sum(axis=2)
        tangent, slopes = self.slopes
        ahead = np.einsum("eqc,etc->eqt", place - self.body.center[:, None], tangent)
        out = rate.sum(axis=1)
        for t in range(2):
            out = out + slopes[t].T @ (ahead[..., t] * rate).sum(axis=1)
        return -out


def road_axes(state: StaticState) -> tuple[Array, float]:
    """Forward, left and up of the road (3, 3) in the wheel's axes, and the axle's height (m) over it."""
    up = state.road.up
    axes = np.array([[1.0, 0.0, 0.0], np.cross(up, [1.0, 0.0, 0.0]), up])
    assert state.road_height is not None
    return axes, -state.road_height * state.road.upright


def _lines(grid: Array, size: float, coarser: float) -> tuple[Array, Array]:
    """Rows and columns of the face, in steps of its grid, at most so far apart as the elements are large."""
    closed = np.concatenate([grid, grid[:1]])
    lowest = closed[..., 2].min(axis=1)
    ends = lowest < lowest.min() + grid[..., 2].max() / 2 * (1 - np.cos(CONTACT))
    shoulders = grid[..., 2].min(axis=0) < GAP
    along, across = (min(size, coarser * one) for one in (AHEAD, BESIDE))
    rows = _chosen(closed, np.where(ends, along, size))
    columns = _chosen(np.swapaxes(grid, 0, 1), np.where(shoulders, across, size))
    return rows[:-1], columns


def _chosen(lines: Array, limit: Array) -> Array:
    """Positions along lines (n, m, 3) whose distance is at most `limit` (n,) m; wide steps divided."""
    places, last = [0.0], 0
    while last < len(lines) - 1:
        after = last + 1
        while after < len(lines) - 1:
            apart = np.linalg.norm(lines[after + 1] - lines[last], axis=1).max()
            if apart > limit[last : after + 2].min():
                break
            after += 1
        apart = np.linalg.norm(lines[after] - lines[last], axis=1).max()
        parts = max(int(np.ceil(apart / limit[[last, after]].min() - 1e-9)), 1)
        places += list(last + (after - last) * np.arange(1, parts + 1) / parts)
        last = after
    return np.array(places)


def _at(grid: Array, rows: Array, columns: Array) -> Array:
    """Points (n, 3) of the face at rows and columns (n,) between its nodes, bilinear; rows closed."""
    around, along = grid.shape[:2]
    i = np.floor(rows).astype(int)
    j = np.minimum(np.floor(columns).astype(int), along - 2)
    s, t = (rows - i)[:, None], (columns - j)[:, None]
    corner = [grid[(i + a) % around, j + b] for a in (0, 1) for b in (0, 1)]
    return (1 - s) * ((1 - t) * corner[0] + t * corner[1]) + s * (
        (1 - t) * corner[2] + t * corner[3]
    )


def _face_elements(grid: Array, lines: tuple[Array, Array]) -> tuple[Array, NDArray[np.intp]]:
    """Corners (e, 4, 3) m of the elements between the lines, and their row and column (e, 2)."""
    rows, columns = lines
    r, c = np.meshgrid(rows, columns, indexing="ij")
    place = _at(grid, r.ravel(), c.ravel())
    quads = ring_quads(len(rows), len(columns))
    i, j = np.divmod(quads[:, 0], len(columns))
    return place[quads], np.stack([i, j], axis=-1)


def _barrel(first: Array, last: Array, size: float) -> Array:
    """Quadrilaterals (e, 4, 3) from one ring of points (n, 3) to another; corners follow the first one."""
    steps = max(int(np.ceil(np.linalg.norm(last - first, axis=1).max() / size - 1e-9)), 1)
    rings = [list(first + step / steps * (last - first)) for step in range(steps + 1)]
    found = [_between(a, b, range(len(first))) for a, b in zip(rings, rings[1:], strict=False)]
    return np.array([one for part in found for one in part])


def _disc(ring: Array, size: float, depth: float) -> Array:
    """Quadrilaterals (e, 4, 3) that close a ring of points (n, 3), shifted by `depth` m along y.

    Rings towards the centre halve their points where these come close; triangles repeat a corner.
    Corners follow each other as the points of the ring do.
    """
    quads: list[list[Array]] = []
    center = ring.mean(axis=0)
    steps = int(np.ceil(abs(depth) / size - 1e-9))
    outer = list(ring)
    for step in range(1, steps + 1):
        inner = list(ring + [0, depth * step / steps, 0])
        quads += _between(outer, inner, range(len(inner)))
        outer = inner
    center = center + [0, depth if steps else 0.0, 0]
    while True:
        radius = float(np.mean([np.linalg.norm(p - center) for p in outer]))
        rings = max(round(radius / size), 1)
        if rings == 1 or len(outer) <= 5:
            n = len(outer)
            quads += [[outer[a], outer[(a + 1) % n], center, center] for a in range(n)]
            break
        share = 1 - 1 / rings
        chosen = [0]
        n = len(outer)
        for a in range(1, n):
            wide = np.linalg.norm(outer[(a + 1) % n] - outer[chosen[-1]]) * share
            if a - chosen[-1] == 2 or wide > size:
                chosen.append(a)
        inner = [center + share * (outer[a] - center) for a in chosen]
        quads += _between(outer, inner, chosen)
        outer = inner
    return np.array(quads)


def _between(
    outer: list[Array], inner: list[Array], chosen: range | list[int]
) -> list[list[Array]]:
    """Elements between two rings, the inner one of the `chosen` points of the outer one."""
    triangles, n = [], len(outer)
    for b, a in enumerate(chosen):
        p, q = outer[a], inner[b]
        after = chosen[(b + 1) % len(inner)]
        r, far = inner[(b + 1) % len(inner)], outer[after]
        if (after - a) % n == 1:
            triangles.append([p, far, r, q])
        else:
            middle = outer[(a + 1) % n]
            triangles += [[p, middle, q, q], [middle, far, r, r], [middle, r, q, q]]
    return triangles


def _slopes(
    body: SoundBody, grid: NDArray[np.intp], rows: int
) -> tuple[Array, list[sparse.csr_matrix]]:
    """Tangents (e, 2, 3), and (e, e) twice: the slope of g along each, by least squares over neighbours.

    Neighbours are the elements beside and diagonal on the face, across no edge and not across the
    contact. Elements of a disc have none.
    """
    e = len(grid)
    number = {(int(i), int(j)): n for n, (i, j) in enumerate(grid) if i >= 0}
    along = body.corners[:, 1] - body.corners[:, 0]
    along = along - (along * body.normal).sum(axis=1, keepdims=True) * body.normal
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    tangent = np.stack([along, np.cross(body.normal, along)], axis=1)
    entries: list[tuple[int, int, Array]] = []
    for n in range(e):
        i, j = grid[n]
        if i < 0:
            continue
        beside = [
            m
            for a in (-1, 0, 1)
            for b in (-1, 0, 1)
            if (a, b) != (0, 0)
            and (m := number.get(((i + a) % rows, j + b))) is not None
            and body.normal[n] @ body.normal[m] > SAME_SIDE
        ]
        if len(beside) < 2:
            continue
        ahead = (body.center[beside] - body.center[n]) @ tangent[n].T
        weight = np.linalg.pinv(ahead, rcond=0.1)
        entries += [(n, m, w) for m, w in zip(beside, weight.T, strict=True)]
        entries.append((n, n, -weight.sum(axis=1)))
    row, column = ([entry[k] for entry in entries] for k in (0, 1))
    value = np.array([entry[2] for entry in entries]).reshape(-1, 2)
    return tangent, [sparse.csr_matrix((value[:, t], (row, column)), (e, e)) for t in range(2)]


def _to_nodes(
    body: SoundBody,
    grid: NDArray[np.intp],
    lines: tuple[Array, Array],
    place: Array,
    shape: tuple[int, int],
    slopes: tuple[Array, list[sparse.csr_matrix]],
) -> sparse.csr_matrix:
    """N (s, e): g at the nodes of the face from g of the elements that they lie in or between."""
    rows, columns = lines
    number = np.full((len(rows), len(columns) - 1), -1)
    own = np.flatnonzero(grid[:, 0] >= 0)
    number[grid[own, 0], grid[own, 1]] = own
    i, j = np.divmod(np.arange(shape[0] * shape[1]), shape[1])
    up = np.searchsorted(rows, i, side="right") - 1
    down = np.where(np.isclose(rows[up], i), up - 1, up) % len(rows)
    right = np.minimum(np.searchsorted(columns, j, side="right") - 1, len(columns) - 2)
    left = np.where(np.isclose(columns[right], j), np.maximum(right - 1, 0), right)
    pairs = {
        (int(n), int(e))
        for a in (up, down)
        for b in (right, left)
        for n, e in enumerate(number[a, b])
        if e >= 0
    }
    node, element = np.array(sorted(pairs)).T
    counts = np.bincount(node, minlength=len(i))
    share = 1.0 / counts[node]
    plain = sparse.csr_matrix((share, (node, element)), (len(i), len(grid)))
    tangent, slope = slopes
    ahead = np.einsum("pc,ptc->pt", place[node] - body.center[element], tangent[element])
    for t in range(2):
        plain = (
            plain
            + sparse.csr_matrix((share * ahead[:, t], (node, element)), plain.shape) @ slope[t]
        )
    return sparse.csr_matrix(plain)


def directions() -> tuple[Array, Array]:
    """Unit vectors (d, 3) over the hemisphere and their solid angles (d,), from Gauss and equal steps."""
    at, weight = np.polynomial.legendre.leggauss(2 * ELEVATIONS)
    up, weight = at[ELEVATIONS:], weight[ELEVATIONS:]
    turn = 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    flat = np.sqrt(1 - up**2)[:, None]
    places = np.stack([flat * np.cos(turn), flat * np.sin(turn), up[:, None] + 0 * turn], axis=-1)
    return places.reshape(-1, 3), np.repeat(weight, AZIMUTHS) * 2 * np.pi / AZIMUTHS


def solved_frequencies(up_to: float) -> Array:
    """0, `APART`, ... Hz to beyond a frequency (Hz): between them g is interpolated to 0.02 dB."""
    return APART * np.arange(np.ceil(up_to / APART) + 1.0)


def admittances(road: PorousLayer | None, frequency: Array, air: SoundAir) -> Complex:
    """Admittances (f,) of a road over that of the air at frequencies (f,) Hz: 0 of a rigid one (None), and at 0 Hz."""
    admittance = np.zeros(len(frequency), complex)
    if road is not None:
        some = frequency > 0
        admittance[some] = 1 / road.impedance(frequency[some], air.speed, air.density)
    return admittance


def transfer(
    tire: SoundingTire,
    microphones: Array,
    frequency: Array,
    air: SoundAir,
    comm: MPI.Comm,
    road: PorousLayer | None = None,
) -> NDArray[np.complex64]:
    """g e^{ikR} (f, k, e) 1/m, single precision, at the solved frequencies, on every process. Collective.

    R from the road under the axle to each microphone (k, 3) m. `road`: a layer that absorbs; None is
    rigid. The frequencies are dealt out to the processes.
    """
    apart, admittance = np.linalg.norm(microphones, axis=1), admittances(road, frequency, air)
    own = {}
    for n in range(comm.rank, len(frequency), comm.size):
        k = 2 * np.pi * frequency[n] / air.speed
        g = tire.body.solve(k, microphones, admittance[n])
        own[n] = (g * np.exp(1j * k * apart)).T.astype(np.complex64)
    every = {n: g for part in comm.allgather(own) for n, g in part.items()}
    return np.stack([every[n] for n in range(len(frequency))])


@dataclass(frozen=True, kw_only=True)
class Transfer:
    """`ahead` (f, k, e) 1/m: g e^{ikR} at `frequency` (f,) Hz from 0 on; `distance` (k,) m: R, from the origin."""

    frequency: Array
    ahead: NDArray[np.complex64]
    distance: Array
    air: SoundAir

    def pressure(self, volume: Complex, lines: Array) -> Complex:
        """Pressure (k, l) Pa, e^{+iwt}, of the displaced volumes U (e, l) m3 at lines (l,) Hz.

        g is interpolated over frequency by a cubic spline, that is by sum_n W(line, n) g(n): a product
        of matrices for each solved frequency n.
        """
        # g(-f) is the conjugate of g(f): no end conditions at 0.
        knots = np.concatenate([-self.frequency[1:2], self.frequency])
        values = np.concatenate([self.ahead[1:2].conj(), self.ahead])
        share = interpolate.CubicSpline(knots, np.eye(len(knots)))(lines)
        out = np.zeros((values.shape[1], len(lines)), complex)
        for n, value in enumerate(values):
            out += share[:, n] * (value.astype(complex) @ volume)
        wave = 2 * np.pi * lines
        delay = np.exp(-1j * wave / self.air.speed * self.distance[:, None])
        return -(wave**2) * self.air.density * delay * out


def source_errors(
    tire: SoundingTire, far: Transfer, microphones: Array, road: PorousLayer | None = None
) -> Array:
    """Errors (n, k, f) dB of the fields of n sources inside, at the frequencies solved but 0 Hz."""
    sources, frequency = tire.inner_sources(), far.frequency[1:]
    admittance = admittances(road, frequency, far.air)
    out = np.zeros((len(sources), len(microphones), len(frequency)))
    for a, source in enumerate(sources):
        for b, f in enumerate(frequency):
            k = 2 * np.pi * f / far.air.speed
            errors = (
                far.ahead[b + 1]
                @ tire.flux_of(source, k, admittance[b])
                * np.exp(-1j * k * far.distance)
            )
            exact = np.zeros(len(microphones), complex)
            for mirror in (np.ones(3), MIRROR):
                r = np.linalg.norm(microphones - source * mirror, axis=1)
                exact += np.exp(-1j * k * r) / (4 * np.pi * r)
            if admittance[b]:
                exact += AbsorbingPlane(k, admittance[b]).source(microphones, source)[0]
            out[a, :, b] = 20 * np.log10(np.abs(errors / exact))
    return out
