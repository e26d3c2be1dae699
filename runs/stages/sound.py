"""Stages radiation and sound: from the tire to microphones, and what these hear of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar

import h5py
import numpy as np

from tireroad.contact.results.error_bars import Measured, of_sound
from tireroad.contact.results.spectra import a_weighting, band_sums
from tireroad.contact.setup import ContactSetup
from tireroad.fem.static.state import StaticState
from tireroad.greens.basis import Basis
from tireroad.greens.tire_sound import (
    FAR,
    SoundAir,
    SoundingTire,
    Transfer,
    directions,
    elements_for,
    solved_frequencies,
    source_errors,
    transfer,
)
from tireroad.runs.files.store import attribute, dataset, put, read_fields, write_fields
from tireroad.runs.scene.tables.sound import SQUEEZED, SoundTable
from tireroad.runs.stages.accuracy import Accuracy
from tireroad.runs.stages.footprint_air import LeavingAir
from tireroad.runs.stages.replay import wheel_motion
from tireroad.runs.stages.spectra import Spectra
from tireroad.runs.stages.stage import UNKNOWN, Computed, Record, Result
from tireroad.runs.stages.vibration import HANN, POWER, decibels
from tireroad.runs.stages.whole_tire import Lines, WholeTire

PRESSURE = 2e-5  # Pa: reference of the levels
RATE = 8000.0  # Hz, of the signals to listen to, or more by powers of two
COARSER = 2.0  # size of the companion's elements over that of the elements
ORDER = 2  # of the elements: the companion's error is four times theirs, three times the difference
WORST = 1.0  # dB: larger errors of the sources inside are warned of

REGIONS = ("tread ahead", "tread behind", "tread above", "left sidewall", "right sidewall", "wheel")
SIDE = 0.7  # |n_y| of a sidewall
SPACING = 0.016  # m: between the microphones of an intensity probe
INTENSITY = 1e-12  # W/m2: reference of its levels
PASS_BY = 7.5  # m: distance of the directivity
KNOWN = 0.9  # least part of a total that lies in bands of known error


def microphones(table: tuple, state: StaticState) -> tuple[list[str], np.ndarray]:
    """Names and places (k, 3) m of a scene's microphones beside the tire in its static state.

    cpx: ISO 11819-2, 0.2 m beside the undeformed sidewall, 0.1 m high, 0.2 m ahead and behind.
    obsi: AASHTO T 360, intensity probes of two microphones 16 mm apart, the outer one second, around 0.1 m
    beside it, 76 mm high, at the contact's ends.
    pass-by: 7.5 m to the left, 1.2 m high.
    """
    side = float(np.abs(state.points[:, 1]).max())
    half = state.footprint().length / 2
    known = {
        "cpx": {"cpx front": (0.2, side + 0.2, 0.1), "cpx rear": (-0.2, side + 0.2, 0.1)},
        "pass-by": {"pass-by": (0.0, 7.5, 1.2)},
        "obsi": {
            f"obsi {end} {place}": (x, side + 0.1 + SPACING / 2 * sign, 0.076)
            for end, x in (("leading", half), ("trailing", -half))
            for place, sign in (("inner", -1), ("outer", 1))
        },
    }
    places: dict[str, tuple[float, ...]] = {}
    for item in table:
        places |= (
            known[item]
            if isinstance(item, str)
            else {f"{item[0]:g}, {item[1]:g}, {item[2]:g} m": item}
        )
    return list(places), np.array(list(places.values()))


def probes(names: list[str]) -> dict[str, tuple[int, int]]:
    """Intensity probes among microphones of these `names`: the numbers of the inner and the outer one of each."""
    pairs = [(name.removesuffix(" inner"), name) for name in names if name.endswith(" inner")]
    return {
        probe: (names.index(inner), names.index(f"{probe} outer"))
        for probe, inner in pairs
        if f"{probe} outer" in names
    }


def intensity(
    inner: np.ndarray, outer: np.ndarray, frequency: np.ndarray, density: float
) -> np.ndarray:
    """Active intensity W/m2 from the inner microphone of a probe to the outer one, of pressures (..., f) Pa.

    I = -Im(p1* p2) / (2 w rho d) of complex amplitudes for e^{+iwt} at f frequencies (Hz), `SPACING` d apart,
    in air of a `density` in kg/m3; a plane wave is seen by a factor of sin(kd) / kd (Fahy, Sound intensity).
    """
    across = (inner.conj() * outer).imag
    return np.asarray(-across / (4 * np.pi * frequency * density * SPACING))


@dataclass(frozen=True, kw_only=True)
class Paths:
    """Green's functions of the air, from the elements to microphones and to directions far away.

    `names` and `places` (k, 3) m; `near`: to the microphones, `far`: to the directions of a
    hemisphere of `FAR` m, `coarse`: to the microphones from larger elements; `error` (k, f) dB: the
    largest one of sources inside at the frequencies solved but 0 Hz; `size` m: of the elements.
    """

    names: list[str]
    places: np.ndarray
    near: Transfer
    far: Transfer
    coarse: Transfer
    error: np.ndarray
    size: float


@dataclass(frozen=True, kw_only=True)
class RadiationStage(Computed[Paths]):
    """Once for a tire, load and speed: the same on every road."""

    name: ClassVar[str] = "radiation"
    reads: ClassVar[tuple[str, ...]] = (
        *(f"sound.{item.name}" for item in fields(SoundTable) if item.name != "air"),
        "heard_up_to",
    )
    static: Result[StaticState]

    @property
    def table(self) -> SoundTable:
        """The table [sound]."""
        sound = self.job.scene.sound
        assert sound is not None, "the stage runs with [sound] only"
        return sound

    def compute(self, record: Record) -> Paths:
        """Two meshes, all microphones and directions at each frequency. Collective."""
        table, comm = self.table, self.job.comm
        up_to, air = self.job.scene.heard_up_to, SoundAir.at(table.temperature)
        frequency, size = solved_frequencies(up_to), elements_for(up_to, air)
        with record.timing("elements"):
            tire, rough = (sounding(self.static.product, table, size, by) for by in (1.0, COARSER))
            for shape in (tire, rough):
                shape.body.checked("sound")
        names, places = microphones(table.microphones, self.static.product)
        tire.body.check_microphones(places, "sound.microphones", names)
        every = np.vstack([places, FAR * directions()[0]])
        apart = np.linalg.norm(every, axis=1)
        with record.timing("solve"):
            found = transfer(tire, every, frequency, air, comm, table.road)
        with record.timing("larger elements"):
            coarse = transfer(rough, places, frequency, air, comm, table.road)
        k = len(places)
        values: dict[str, Any] = {"frequency": frequency, "air": air}
        near = Transfer(ahead=found[:, :k], distance=apart[:k], **values)
        with record.timing("sources inside"):
            error = np.abs(source_errors(tire, near, places, table.road)).max(axis=0)
        record.headline |= {
            "elements": (len(tire.body.area), "-"),
            "frequencies": (len(frequency), "-"),
            "highest frequency": (float(frequency[-1]), "Hz"),
            "error of sources inside": (float(error.max()), "dB"),
        }
        record.indicators["largest element"] = (tire.body.edge, "m")
        record.indicators["solid angles lack"] = (float(np.abs(tire.body.defect).max()), "-")
        if error.max() > WORST:
            record.warnings.append(
                f"the fields of sources inside the tire are up to {error.max():.2g} dB off at the microphones: the "
                "levels there may be as much"
            )
        return Paths(
            names=names,
            places=places,
            near=near,
            far=Transfer(ahead=found[:, k:], distance=apart[k:], **values),
            coarse=Transfer(ahead=coarse, distance=apart[:k], **values),
            error=error,
            size=size,
        )

    def write(self, file: h5py.File, product: Paths) -> None:
        """All fields."""
        put(file, "microphones", product.places, "m")
        file["microphones"].attrs["names"] = product.names
        put(file, "frequency", product.near.frequency, "Hz")
        put(file, "near", product.near.ahead, "1/m")
        put(file, "far", product.far.ahead, "1/m")
        put(file, "coarse", product.coarse.ahead, "1/m")
        put(file, "error_of_sources_inside", product.error, "dB")
        file.attrs["speed_of_sound"], file.attrs["density"] = vars(product.near.air).values()
        file.attrs["size"] = product.size

    def read(self, file: h5py.File) -> Paths:
        """The same, read back."""
        air = SoundAir(
            speed=float(file.attrs["speed_of_sound"]), density=float(file.attrs["density"])
        )
        places = file["microphones"][:]
        values: dict[str, Any] = {"frequency": file["frequency"][:], "air": air}
        near, far = (np.linalg.norm(group, axis=1) for group in (places, FAR * directions()[0]))
        return Paths(
            names=[str(name) for name in file["microphones"].attrs["names"]],
            places=places,
            near=Transfer(ahead=file["near"][:], distance=near, **values),
            far=Transfer(ahead=file["far"][:], distance=far, **values),
            coarse=Transfer(ahead=file["coarse"][:], distance=near, **values),
            error=file["error_of_sources_inside"][:],
            size=float(file.attrs["size"]),
        )


def sounding(
    state: StaticState, table: SoundTable, size: float, coarser: float = 1.0
) -> SoundingTire:
    """The tire of a static state in elements of at most `coarser` times `size` m."""
    rest: dict[str, Any] = {key: getattr(table, key) for key in ("wheel", "wheel_depth", "leak")}
    return SoundingTire.of(state, size, coarser=coarser, **rest)


@dataclass(frozen=True, kw_only=True)
class SoundPressure:
    """Sound pressure of a run at k microphones, up to the limit of the model.

    `names` and `places` (k, 3) m; `frequency` (f,) Hz, `pressure` (k, f) Pa: complex amplitudes
    for e^{+iwt}, from a Hann window; `centre` (b,) Hz with the third-octave `level` (k, b) dB re
    20 uPa, A-weighted `weighted` (k, b), its `error` (k, b) dB, NaN where that of the vibration is
    unknown, or where most of the sound is that of air squeezed out of the footprint, and `of_elements` (k, b) dB, what of it is of
    the boundary elements; `of_vibration` and `of_air` (k, b) dB re 20 uPa: levels of the tire's vibrations alone, and of that air
    alone, NaN without it; the sound power
    `power` (b,) dB re 1 pW and the `efficiency` (b,) of radiation; `total`, `total_weighted` (k,) and
    `total_power`, its A-weighted value second, (2,): of all lines; `total_error`,
    `total_weighted_error` (k,) dB, NaN where bands of unknown error hold more than a tenth of it;
    `probes`: names of the i intensity probes among the microphones; `intensity` (i, f) W/m2 outward, from a Hann
    window; its A-weighted third octaves `intensity_level` (i, b) dB re 1 pW/m2, NaN of inward ones, and the
    pressure-intensity index `intensity_index` (i, b) dB, pressure level less that of the intensity's magnitude;
    `total_intensity` (i,): the A-weighted level of all lines; `directivity` (b, elevations, azimuths) dB re 20 uPa at 7.5 m; `signal` (k, n) Pa at `rate` Hz;
    `unknown_error`: what of the vibration's error is unknown, and why, empty if nothing is;
    `solved` (g,) Hz and `weight` (g, k, s) Pa s/m3: pressure per volume velocity at each node of
    the outer face; `share` (k, b, r): of the pressure's square, from each of `REGIONS`; `shares`
    (k, b, e): from each element, with `outline` (e, 4, 2) deg and -: angle around the axle from the
    lowest point, and place from bead to bead from 0 to 1, NaN on the wheel.
    """

    names: list[str]
    places: np.ndarray = dataset("m", "microphones")
    frequency: np.ndarray = dataset("Hz")
    pressure: np.ndarray = dataset("Pa")
    centre: np.ndarray = dataset("Hz", "third_octave/centre")
    level: np.ndarray = dataset("dB re 20 uPa", "third_octave/level")
    weighted: np.ndarray = dataset("dB(A) re 20 uPa", "third_octave/level_a")
    error: np.ndarray = dataset("dB", "third_octave/level_error")
    of_elements: np.ndarray = dataset("dB", "third_octave/element_error")
    of_vibration: np.ndarray = dataset("dB re 20 uPa", "third_octave/vibration_level")
    of_air: np.ndarray = dataset("dB re 20 uPa", "third_octave/air_level")
    power: np.ndarray = dataset("dB re 1 pW")
    efficiency: np.ndarray = dataset("-")
    total: np.ndarray = dataset("dB re 20 uPa", "total/level")
    total_weighted: np.ndarray = dataset("dB(A) re 20 uPa", "total/level_a")
    total_error: np.ndarray = dataset("dB", "total/level_error")
    total_weighted_error: np.ndarray = dataset("dB", "total/level_a_error")
    total_power: np.ndarray = dataset("dB re 1 pW", "total/power")
    probes: list[str]
    intensity: np.ndarray = dataset("W/m2")
    intensity_level: np.ndarray = dataset("dB(A) re 1 pW/m2", "third_octave/intensity_level_a")
    intensity_index: np.ndarray = dataset("dB")
    total_intensity: np.ndarray = dataset("dB(A) re 1 pW/m2", "total/intensity_level_a")
    directivity: np.ndarray = dataset("dB re 20 uPa at 7.5 m", "directivity/level")
    signal: np.ndarray = dataset("Pa", "signal/pressure")
    rate: float
    unknown_error: str = attribute(default="")
    solved: np.ndarray = dataset("Hz", "transfer/frequency")
    weight: np.ndarray = dataset("Pa s/m3", "transfer/weight")
    share: np.ndarray = dataset("-", "contribution/region")
    shares: np.ndarray = dataset("-", "contribution/element")
    outline: np.ndarray = dataset("deg, -", "contribution/outline")


@dataclass(frozen=True, kw_only=True)
class SoundStage(WholeTire[SoundPressure]):
    """Pressure from the coordinates of the run and the Green's functions of the air."""

    name: ClassVar[str] = "sound"
    radiation: Result[Paths]
    reads: ClassVar[tuple[str, ...]] = (*WholeTire.reads, "sound.air")
    lines: Result[Lines | None]
    spectra: Result[Spectra] | None = None
    accuracy: Result[Accuracy] | None = None

    def compute(self, record: Record) -> SoundPressure | None:
        """None but on the root process. Collective."""
        paths, lines, state = self.radiation.product, self.lines.product, self.static.product
        setup = self.setup.product  # made by all processes
        if lines is None:
            return None
        table = self.job.scene.sound
        assert table is not None, "the stage runs with [sound] only"
        top = float(paths.near.frequency[-1])
        below = lines.frequency <= top
        if not below.all():
            record.warnings.append(
                f"the sound ends at sound.up_to = {top:g} Hz, the forces at {lines.frequency[-1]:.4g} Hz"
            )
        basis = Basis.of(self.rotating.product)
        shape, rigid = basis.face(len(state.points)), wheel_motion(basis)
        lines = replace(
            lines,
            frequency=lines.frequency[below],
            amplitude=lines.amplitude[below],
            spectrum=lines.spectrum[below],
        )
        with record.timing("elements"):
            tire, rough = (sounding(state, table, paths.size, by) for by in (1.0, COARSER))
            volumes, coarse = (one.volumes(shape, rigid) for one in (tire, rough))
        vibration = Heard(
            paths=paths,
            tire=tire,
            frequency=lines.frequency,
            volume=volumes @ lines.amplitude.T,
            rough=coarse @ lines.amplitude.T,
        )
        heard, over_time = vibration, volumes @ lines.spectrum.T
        if (air := self._air(record, lines, tire, setup)) is not None:
            with record.timing("air of the footprint"):
                amplitude, spectrum = air.volumes(lines.frequency)
                rougher, _ = air.on(rough, state).volumes(lines.frequency)
            heard = replace(
                vibration,
                volume=vibration.volume + amplitude,
                rough=vibration.rough + rougher,
            )
            over_time = over_time + spectrum
        with record.timing("pressure"):
            centre, _ = vibration.bands(np.zeros(len(lines.frequency)))
            errors = self._errors(paths, volumes, centre)
            parts = _sound(heard, vibration, errors, over_time, lines.duration)
            normal = _normal_velocity(tire, shape, lines.amplitude, lines.frequency)
            efficiency = vibration.efficiency(normal)
        unknown = self.spectra.product.unknown_error if self.spectra else UNKNOWN
        pressure = SoundPressure(efficiency=efficiency, unknown_error=unknown, **parts)
        _describe(record, pressure)
        return pressure

    def _air(
        self, record: Record, lines: Lines, tire: SoundingTire, setup: ContactSetup | None
    ) -> LeavingAir | None:
        """The air squeezed out of the footprint; None where it is not asked for or not known. Root process only."""
        table = self.job.scene.sound
        assert table is not None, "the stage runs with [sound] only"
        is_heard = lines.frequency[-1] >= SQUEEZED if table.air is None else table.air
        if not is_heard or self.contact is None or setup is None:
            return None
        with record.timing("air of the footprint"):
            arguments = tire, self.static.product, self.radiation.product.far
            air = LeavingAir.of(self.job, setup, lines, *arguments)
        if air is None:
            record.notes.append(
                "the air squeezed out of the footprint is not in the sound: that needs contact points on a grid (contact.points) on a plane"
            )
            return None
        record.indicators["mean gap in the footprint"] = (air.height, "m")
        return air

    def _errors(self, paths: Paths, volumes: np.ndarray, bands: np.ndarray) -> np.ndarray:
        """Errors (k, b) dB of the vibration's levels in bands (b,) Hz at the microphones, NaN where unknown.

        As of the forces (contact.results.error_bars), by the pressures of the vibrations in the error bars' companions: `volumes`
        (e, m) displaced per coordinate.
        """
        accuracy = self.accuracy.product if self.accuracy else None
        if accuracy is None or not accuracy.vibrations:
            return np.full((len(paths.names), len(bands)), np.nan)

        def at_microphones(lines: np.ndarray) -> Measured:
            frequency = accuracy.spacing * np.arange(len(lines))
            frequency = frequency[frequency <= paths.near.frequency[-1]]
            pressure = np.zeros((len(frequency), len(paths.names)), complex)
            moved = volumes @ lines[1 : len(frequency)].T
            pressure[1:] = paths.near.pressure(moved, frequency[1:]).T
            return of_sound(pressure, accuracy.spacing, bands)

        squares = np.zeros((len(bands), len(paths.names)))
        for both in accuracy.vibrations.values():
            for one in both:
                bars = one.relation.bars(at_microphones(one.run), at_microphones(one.companion))
                squares += bars.level**2
        return np.sqrt(squares).T

    def write(self, file: h5py.File, product: SoundPressure) -> None:
        """All fields of the product."""
        write_fields(file, product)
        file["microphones"].attrs["names"] = file.attrs["microphone_names"] = product.names
        file["intensity"].attrs["names"] = file.attrs["probe_names"] = product.probes
        file["contribution/region"].attrs["names"] = REGIONS
        file["signal/pressure"].attrs["rate"] = product.rate
        elevation, azimuth = angles()
        put(file, "directivity/elevation", elevation, "deg")
        put(file, "directivity/azimuth", azimuth, "deg")

    def read(self, file: h5py.File) -> SoundPressure:
        """The same, read back."""
        fields = read_fields(file, SoundPressure)
        names = [str(name) for name in file["microphones"].attrs["names"]]
        rate = float(file["signal/pressure"].attrs["rate"])
        return SoundPressure(names=names, probes=list(probes(names)), rate=rate, **fields)


def angles() -> tuple[np.ndarray, np.ndarray]:
    """Elevations over the road and azimuths from ahead to the left, deg, of `directions`."""
    way = directions()[0]
    elevation = np.unique(np.degrees(np.arcsin(way[:, 2])).round(9))
    azimuth = np.unique((np.degrees(np.arctan2(way[:, 1], way[:, 0])) % 360).round(9))
    return elevation, azimuth


@dataclass(frozen=True, kw_only=True)
class Heard:
    """Displaced volumes of the elements, `volume` (e, f) and `rough` (e', f) m3, of larger ones."""

    paths: Paths
    tire: SoundingTire
    frequency: np.ndarray
    volume: np.ndarray
    rough: np.ndarray

    @cached_property
    def pressure(self) -> np.ndarray:
        """At the microphones, (k, f) Pa."""
        return self.paths.near.pressure(self.volume, self.frequency)

    @cached_property
    def coarse(self) -> np.ndarray:
        """The same of larger elements."""
        return self.paths.coarse.pressure(self.rough, self.frequency)

    @cached_property
    def far(self) -> np.ndarray:
        """In the directions of the hemisphere, (d, f) Pa at `FAR` m."""
        return self.paths.far.pressure(self.volume, self.frequency)

    @cached_property
    def power(self) -> np.ndarray:
        """Sound power (f,) W, mean over time."""
        angle = directions()[1][:, None]
        return (
            (np.abs(self.far) ** 2 * angle).sum(axis=0)
            * FAR**2
            / (2 * self.paths.near.air.impedance)
        )

    def efficiency(self, normal: np.ndarray) -> np.ndarray:
        """Sound power over that of a plane wave with the face's mean square normal velocity, (b,).

        `normal` (f,) m4/s2: the integral over the face of the velocity's mean square.
        """
        _, power = self.bands(self.power)
        _, plane = self.bands(self.paths.near.air.impedance * normal)
        return power / np.maximum(plane, np.finfo(float).tiny)

    def bands(self, square: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Third octaves (b,) Hz and sums (b, ...) of (f, ...) which the Hann window makes larger."""
        return band_sums(self.frequency, square / HANN)


def _normal_velocity(
    tire: SoundingTire, shape: np.ndarray, a: np.ndarray, frequency: np.ndarray
) -> np.ndarray:
    """The integral over the face in the air of the mean square normal velocity, (f,) m4/s2."""
    size = np.linalg.norm(tire.area, axis=1)
    some = size > 0
    unit = tire.area[some] / np.sqrt(size[some])[:, None]
    moved = np.einsum("sc,scm->sm", unit, shape.reshape(len(size), 3, -1)[some])
    # Contiguous, or BLAS is not used: 17 times the time.
    parts = (moved @ np.ascontiguousarray(part).T for part in (a.real, a.imag))
    return sum((part**2).sum(axis=0) for part in parts) * (2 * np.pi * frequency) ** 2 / 2


def _sound(
    heard: Heard,
    vibration: Heard,
    of_vibration: np.ndarray,
    volume: np.ndarray,
    duration: float,
) -> dict[str, Any]:
    """The fields of SoundPressure but the efficiency; `volume` (e, f): of the record over time.

    `vibration`: what of all that is `heard` the tire's face makes; `of_vibration` (k, b) dB: the error of its levels.
    """
    paths, frequency = heard.paths, heard.frequency
    ears = 10 ** (a_weighting(frequency) / 10)
    square = (np.abs(heard.pressure) ** 2 / 2).T
    centre, band = heard.bands(square)
    _, weighted = heard.bands(square * ears[:, None])
    _, coarse = heard.bands((np.abs(heard.coarse) ** 2 / 2).T)
    _, power = heard.bands(heard.power)
    _, away = heard.bands((np.abs(heard.far) ** 2 / 2).T)
    elements = _of_elements(paths, centre, 10 * np.log10(coarse / band))
    _, alone = heard.bands((np.abs(vibration.pressure) ** 2 / 2).T)
    level, air = decibels(alone, PRESSURE**2).T, np.full(alone.T.shape, np.nan)
    error = np.hypot(elements, of_vibration)
    if heard is not vibration:
        _, rest = heard.bands((np.abs(heard.pressure - vibration.pressure) ** 2 / 2).T)
        air = decibels(rest, PRESSURE**2).T
        error = np.where(air > level, np.nan, error)
    every, every_weighted = (part.sum(axis=0) / HANN for part in (square, square * ears[:, None]))
    share, shares = _shares(heard)
    elevation, azimuth = angles()
    near = decibels(away * (FAR / PASS_BY) ** 2, PRESSURE**2)
    rate = RATE * 2 ** max(0, math.ceil(math.log2(4 * frequency[-1] / RATE)))
    return {
        "names": paths.names,
        "places": paths.places,
        "frequency": frequency,
        "pressure": heard.pressure,
        "centre": centre,
        "level": decibels(band, PRESSURE**2).T,
        "weighted": decibels(weighted, PRESSURE**2).T,
        "error": error,
        "of_elements": elements,
        "of_vibration": level,
        "of_air": air,
        "power": decibels(power, POWER),
        "total": decibels(every, PRESSURE**2),
        "total_weighted": decibels(every_weighted, PRESSURE**2),
        "total_error": _total_error(band.T, every, error),
        "total_weighted_error": _total_error(weighted.T, every_weighted, error),
        "total_power": decibels(
            np.array([heard.power.sum(), (heard.power * ears).sum()]) / HANN, POWER
        ),
        **_intensities(heard, ears),
        "directivity": near.reshape(len(centre), len(elevation), len(azimuth)),
        "signal": _signal(paths, volume, frequency, duration, rate).astype("f4"),
        "rate": rate,
        "solved": paths.near.frequency,
        "weight": _weights(paths, heard.tire),
        "share": share,
        "shares": shares.astype("f4"),
        "outline": heard.tire.outline,
    }


def _intensities(heard: Heard, ears: np.ndarray) -> dict[str, Any]:
    """The fields of the intensity; `ears` (f,): the A-weighting as a factor of powers."""
    pairs = probes(heard.paths.names)
    if not pairs:
        bands = np.zeros((0, len(heard.bands(np.zeros(len(heard.frequency)))[0])))
        lines = np.zeros((0, len(heard.frequency)))
        rest = {"intensity_index": bands, "total_intensity": np.zeros(0)}
        return {"probes": [], "intensity": lines, "intensity_level": bands, **rest}
    inner, outer = (heard.pressure[[pair[k] for pair in pairs.values()]] for k in (0, 1))
    lines = intensity(inner, outer, heard.frequency, heard.paths.near.air.density)
    middle = np.abs((inner + outer) / 2) ** 2 / 2
    _, flux = heard.bands(lines.T)
    _, weighted = heard.bands((lines * ears).T)
    _, square = heard.bands(middle.T)
    with np.errstate(divide="ignore"):
        index = 10 * np.log10(square / PRESSURE**2) - 10 * np.log10(np.abs(flux) / INTENSITY)
        levels = [
            10 * np.log10(np.where(part > 0, part, np.nan) / INTENSITY)
            for part in (weighted, (lines * ears).sum(axis=1) / HANN)
        ]
    return {
        "probes": list(pairs),
        "intensity": lines,
        "intensity_level": levels[0].T,
        "intensity_index": index.T,
        "total_intensity": levels[1],
    }


def _total_error(band: np.ndarray, every: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Error (k,) dB of the sum `every` (k,) of all lines, from those of bands (k, b), Pa2.

    Errors of bands have one sign and the other: their squares add. NaN where bands of unknown error, or what
    lies in no band, hold more than a tenth.
    """
    loud = np.where(np.isfinite(error), band, 0.0)
    held = loud.sum(axis=1)
    total = np.linalg.norm(loud * np.nan_to_num(error), axis=1) / np.maximum(held, 1e-300)
    return np.where(held >= KNOWN * every, total, np.nan)


def _of_elements(paths: Paths, centre: np.ndarray, coarser: np.ndarray) -> np.ndarray:
    """Errors (k, b) dB of the boundary elements, by larger ones (b, k) dB and by sources inside."""
    elements = coarser.T / (COARSER**ORDER - 1)
    solved = paths.near.frequency[1:]
    inside = np.array([np.interp(centre, solved, error) for error in paths.error]).reshape(
        len(paths.names), -1
    )
    return np.hypot(elements, inside)


def _signal(
    paths: Paths, volume: np.ndarray, frequency: np.ndarray, duration: float, rate: float
) -> np.ndarray:
    """Pressure (k, n) Pa over time at `rate` Hz, of the transform of the record."""
    pressure = paths.near.pressure(volume, frequency)
    count = round(duration * rate)
    whole = np.zeros((len(pressure), count // 2 + 1), complex)
    which = np.rint(frequency * duration).astype(int)
    whole[:, which] = pressure
    return np.fft.irfft(whole, count, axis=1) * count


def _weights(paths: Paths, tire: SoundingTire) -> np.ndarray:
    """Pressure per volume velocity of each node (g, k, s) Pa s/m3, single precision."""
    near = paths.near
    wave = 2 * np.pi * near.frequency[:, None, None]
    delay = np.exp(-1j * wave / near.air.speed * near.distance[:, None])
    weight = np.stack([(tire.nodes @ column.T).T for column in near.ahead])
    return (1j * wave * near.air.density * delay * weight).astype(np.complex64)


def _shares(heard: Heard) -> tuple[np.ndarray, np.ndarray]:
    """Shares of the pressure's square in a band, of the regions (k, b, r) and the elements (k, b, e).

    Of one line, Re(conj(p) p_e) / |p|^2 with p_e the pressure of one element; of a band, its lines
    by their squares. They add up to 1; what cancels others is negative.
    """
    near, tire = heard.paths.near, heard.tire
    centre, _ = heard.bands(np.zeros(len(heard.frequency)))
    region = _regions(tire)
    k, e = len(heard.pressure), len(region)
    shares = np.zeros((k, len(centre), e))
    wave = 2 * np.pi * heard.frequency
    delay = np.exp(-1j * wave / near.air.speed * near.distance[:, None])
    for b, middle in enumerate(centre):
        some = np.flatnonzero(
            (heard.frequency > middle * 10**-0.05) & (heard.frequency < middle * 10**0.05)
        )
        # g at the middle of the band: a picture needs no more.
        after = min(int(np.searchsorted(near.frequency, middle)), len(near.frequency) - 1)
        ahead = max(after - 1, 0)
        part = (middle - near.frequency[ahead]) / max(
            near.frequency[after] - near.frequency[ahead], 1e-9
        )
        g = (1 - part) * near.ahead[ahead] + part * near.ahead[after]
        undelayed = heard.pressure[:, some] / delay[:, some]
        for m in range(k):
            each = -(wave[some] ** 2) * near.air.density * g[m][:, None] * heard.volume[:, some]
            parts = (undelayed[m].conj() * each).real.sum(axis=1)
            shares[m, b] = parts / max(abs(parts.sum()), 1e-300)
    regions = np.stack(
        [shares[..., region == r].sum(axis=-1) for r in range(len(REGIONS))], axis=-1
    )
    return regions, shares


def _regions(tire: SoundingTire) -> np.ndarray:
    """Number of the region of each element, (e,)."""
    side, place = tire.body.normal[:, 1], tire.body.center
    region = np.where(place[:, 0] >= 0, 0, 1)
    region[place[:, 2] > tire.height] = 2
    region[side > SIDE], region[side < -SIDE] = 3, 4
    region[~tire.face] = 5
    return region


def _told(record: Record, name: str, value: float, error: float, unit: str) -> None:
    """A level and its error in the headline."""
    record.tell(name, value, unit)
    record.tell(f"error of the {name}", error, "dB")


def _describe(record: Record, sound: SoundPressure) -> None:
    """Levels at the microphones with their errors, the CPX level, and the sound power."""
    if sound.unknown_error:
        record.headline["error of the vibration"] = (sound.unknown_error, "-")
    for k, name in enumerate(sound.names):
        for kind, total, error, unit in (
            ("sound pressure level", sound.total, sound.total_error, "dB"),
            (
                "A-weighted sound pressure level",
                sound.total_weighted,
                sound.total_weighted_error,
                "dB(A)",
            ),
        ):
            _told(record, f"{kind} at {name}", total[k], error[k], f"{unit} re 20 uPa")
    for name, unit in (("CPX", "dB(A) re 20 uPa"), ("OBSI", "dB(A) re 1 pW/m2")):
        heard = [k for k, one in enumerate(sound.names) if one.startswith(f"{name.lower()} ")]
        if not heard:
            continue
        levels = sound.total_weighted[heard] if name == "CPX" else sound.total_intensity
        mean = 10 * np.log10((10 ** (levels / 10)).mean())
        # Errors of one vibration at several microphones go together: they do not average out.
        error = sound.total_weighted_error[heard].mean()
        _told(record, f"A-weighted {name} level", mean, error, unit)
    if sound.probes:
        index = sound.intensity_index
        record.indicators["largest pressure-intensity index of a third octave"] = (
            float(index.max()) if index.size else math.nan,
            "dB",
        )
    if sound.of_elements.size:
        largest = float(sound.of_elements.max())
        record.indicators["largest error of a third octave by the boundary elements"] = (
            largest,
            "dB",
        )
    for name, value, unit in zip(
        ("sound power level", "A-weighted sound power level"),
        sound.total_power,
        ("dB re 1 pW", "dB(A) re 1 pW"),
        strict=True,
    ):
        _told(record, name, value, math.nan, unit)
    record.headline["band"] = (f"{sound.frequency[0]:.3g} to {sound.frequency[-1]:.4g} Hz", "-")
