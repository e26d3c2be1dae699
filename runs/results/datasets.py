"""The datasets of all result files, with shape, unit and meaning.

The page docs/results.md and `tireroad info` show this table; a test compares it with the files of a run.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from typing import NamedTuple

from tireroad.contact.results.error_bars import CAUSES

CORNER = "kg, m, N, rad"  # rows of forces and moments, columns of translations and rotations
STANDS_FOR = {
    "NAME": "[^/]+",
    "PART": ".+",
    "AXIS": "[^/]+",
    "WHERE": "(contact|force)",
    "FORCE": "(contact_force|axle_force)",
    "CAUSE": f"({'|'.join(CAUSES)})",
}
NOTATION = """\
A part of a name in capitals stands for several: `cords/NAME/force` is the force of every line of cords.
Letters of shapes: `n` nodes, `e` elements, `s` nodes of the outer face, `c` contact points, `nt` time steps,
`m` modes, `q` states, `f` frequencies, `k` forces, microphones or points, `b` third octaves."""


class Dataset(NamedTuple):
    """A dataset of a result file."""

    name: str
    shape: str
    unit: str
    meaning: str


DATASETS: Mapping[str, tuple[Dataset, ...]] = {
    file: tuple(Dataset(*row) for row in rows)
    for file, rows in {
        "static.h5": (
            ("mesh/points", "n, 3", "m", "nodes of the undeformed mesh"),
            ("mesh/cells", "e, (order + 1)³", "-", "nodes of each element, in the order of Lagrange's shape functions"),
            ("displacement", "n, 3", "m", "displacement of the nodes"),
            ("surface/points", "s, 3", "m", "nodes of the outer face, undeformed"),
            ("surface/displacement", "s, 3", "m", "their displacement"),
            ("surface/quads", "e, 4", "-", "corners of the faces of elements"),
            ("surface/force", "s", "N", "force of the road on each node, along its normal"),
            ("surface/pull", "s, 2", "N", "horizontal force of the road, with friction"),
            ("surface/area", "s", "m2", "horizontal projection of the area that belongs to a node"),
            ("surface/half_sizes", "s, 2", "m", "half width of that area around and across"),
            ("surface/ring_rate", "s", "m/rad", "motion around the tire per radian of rotation"),
            ("contact/index", "c", "-", "nodes of the outer face near the road"),
            ("contact/points", "c, 3", "m", "their places"),
            ("contact/force", "c, 3", "N", "force of the road on them"),
            ("contact/gap", "c", "m", "height over the road"),
            ("contact/area", "c", "m2", "area that belongs to them"),
            ("contact/pressure", "c", "Pa", "contact pressure"),
            ("cords/NAME/points", "around, along, 3", "m", "integration points of a line of cords"),
            ("cords/NAME/force", "around, along", "N", "force of one cord there, tension positive"),
            ("cords/NAME/area", "around, along", "m2", "area of the ply that belongs to a point"),
        ),
        "stiffness.h5": (
            ("load", "", "N", "load at which the stiffness holds"),
            ("vertical", "", "N/m", "slope of the load over the deflection"),
            ("vertical_tangent", "", "N/m", "the same by the tangent of the static state"),
            ("vertical_stuck", "", "N/m", "the same with the whole footprint stuck"),
            ("longitudinal", "", "N/m", "fore and aft, standing, footprint stuck"),
            ("lateral", "", "N/m", "sidewise, standing, footprint stuck"),
            ("torsional", "", "N m/rad", "about the vertical, standing, footprint stuck"),
            ("matrix", "6, 6", "N/m, N/rad, N m/m, N m/rad", "stiffness of the stuck footprint about its centre"),
            ("curve/deflection", "k", "m", "deflections of the load curve"),
            ("curve/load", "k", "N", "load"),
            ("curve/stiffness", "k", "N/m", "slope of the curve"),
            ("curve/tangent", "k", "N/m", "slope by the tangent of each state"),
            ("curve/footprint_length", "k", "m", "length of the footprint"),
            ("curve/footprint_width", "k", "m", "its width"),
            ("curve/footprint_area", "k", "m2", "its area"),
            ("curve/pressure", "k", "Pa", "mean contact pressure"),
            ("curve/points", "k", "-", "nodes in contact"),
            ("curve/rolling_radius", "k", "m", "rolling radius"),
            ("slide/AXIS/moved", "k", "m or -", "with friction: displacement of the road under the standing tire; slip of a rolling one"),
            ("slide/AXIS/force", "k", "N", "horizontal force"),
            ("slide/AXIS/tangent", "k", "N/m or N", "its slope"),
            ("slide/AXIS/start", "", "N/m or N", "slope as it begins"),
            ("slide/AXIS/moment", "k", "N m", "moment about the vertical"),
            ("slide/AXIS/sticks", "k", "-", "share of the load that sticks"),
        ),
        "modes.h5": (
            ("frequency", "m", "Hz", "frequencies of the undamped tire about its static state"),
            ("residual", "m", "-", "relative residual of each mode"),
            ("name", "m", "-", "names of the modes"),
            ("motion", "m", "-", "kind of motion in words"),
            ("wave_number", "m", "-", "waves around the tire"),
            ("wave_share", "m", "-", "share of that wave number in the mode"),
            ("nodal_lines", "m", "-", "nodal lines along the tread"),
            ("damping", "m", "-", "ratio to critical damping; NaN of rigid modes"),
            ("loss_factor", "m", "-", "loss factor by the strain energy of the compounds"),
            ("effective_mass", "m, 6", "kg, kg m2", "effective mass at the hub: x, y, z, and about x, y, z"),
            ("surface/points", "s, 3", "m", "nodes of the outer face in the static state"),
            ("surface/shape", "m, s, 3", "kg^-1/2", "mass-normalised shapes there"),
            ("turning/shape", "j, s, 3", "kg^-1/2", "rotation shapes that join the modes"),
            ("projected/squares", "m", "1/s2", "squared circular frequencies of modes and shapes"),
            ("projected/gyroscopic", "m, m", "1/rad", "G, projected"),
            ("projected/convective", "m, m", "1/rad2", "S, projected"),
            ("projected/body", "m, m", "1/rad", "B, projected"),
            ("projected/momentum", "3, m", "kg^1/2", "momentum that each coordinate's rate carries"),
            ("projected/losses", "m, m", "1/s", "damping by the losses of the compounds"),
            ("projected/rise", "m, m", "1/s2", "rise of the stiffness by moduli at the modes' own frequencies"),
            ("projected/band_rise", "m", "1/s2", "the same of the moduli in the middle of the band"),
            ("cavity/frequency", "a", "Hz", "frequencies of the air with rigid walls, at rest"),
            ("cavity/circular", "a", "rad/s", "the same as circular frequencies"),
            ("cavity/gyroscopic", "a, a", "1/rad", "skew matrix of the air that turns with the wheel"),
            ("cavity/convective", "a, a", "1/rad2", "its convective matrix"),
            ("cavity/coupling", "a + 1, m", "1/s", "coupling of the air to the modes"),
            ("cavity/loss", "a", "1/s", "rates of loss"),
            ("cavity/momentum", "3, a", "kg^1/2", "momentum of the air"),
            ("cavity/pressure", "a + 1, a + 1", "m^1/2/kg^1/2 s", "pressure around the tire per coordinate"),
            ("corner/places", "s, 3", CORNER, "nodes of the outer face, m"),
            ("corner/mass", "m, 6", CORNER, "mass between modes and motions of the rim"),
            ("corner/stiffness", "m, 6", CORNER, "stiffness between them"),
            ("corner/gyroscopic", "m, 6", CORNER, "G between them, per rad/s"),
            ("corner/convective", "m, 6", CORNER, "S between them, per rad2/s2"),
            ("corner/body", "m, 6", CORNER, "B between them"),
            ("corner/body_convective", "m, 6", CORNER, "S_B between them"),
            ("corner/own_mass", "6, 6", CORNER, "mass of the tire in motions of the rim"),
            ("corner/own_stiffness", "6, 6", CORNER, "stiffness in them"),
            ("corner/own_gyroscopic", "6, 6", CORNER, "G in them"),
            ("corner/own_convective", "6, 6", CORNER, "S in them"),
        ),
        "rotating.h5": (
            ("eigenvalue", "q", "1/s", "eigenvalues of the rolling tire"),
            ("frequency", "q", "Hz", "their frequencies"),
            ("right", "m, q", "-", "right vectors"),
            ("left", "q, m", "s", "left vectors"),
            ("residual", "q", "-", "relative residual of the right vectors"),
            ("left_residual", "q", "-", "relative residual of the left vectors"),
            ("block", "p, p", "1/s", "block of states that are nearly defective"),
            ("block_right", "m, p", "-", "its right vectors"),
            ("block_left", "p, m", "s", "its left vectors"),
            ("name", "q", "-", "names of the states"),
            ("motion", "q", "-", "kind of motion in words"),
            ("wave_number", "q", "-", "waves around the tire"),
            ("wave_share", "q", "-", "share of that wave number"),
            ("nodal_lines", "q", "-", "nodal lines along the tread"),
            ("travel", "q", "-", "1 with the rotation, -1 against it"),
            ("damping", "q", "-", "ratio to critical damping"),
            ("air_share", "q", "-", "share of the air in the cavity"),
            ("turning/PART", "j", "as above", "the same of states that are mostly rotation shapes; `place` among all"),
            ("basis/shape", "s, q", "kg^-1/2", 'of rotation.method = "full": fields of the states'),
            ("basis/momentum", "3, q", "kg^1/2", "their momentum"),
            ("campbell/speed", "g", "rad/s", "speeds of the Campbell diagram"),
            ("campbell/eigenvalue", "g, k", "1/s", "eigenvalues along each branch"),
            ("campbell/frequency", "g, k", "Hz", "damped frequencies"),
            ("campbell/undamped", "g, k", "Hz", "undamped frequencies"),
            ("campbell/similarity", "g, k", "-", "similarity of a state to that of the speed before"),
            ("campbell/name", "k", "-", "names of the branches"),
        ),
        "greens.h5": (
            ("WHERE/eigenvalue", "q", "1/s", "poles of the response at the `contact` points or of each `force`"),
            ("WHERE/output", "r, q", "kg^-1/2", "their output, C"),
            ("WHERE/input", "q, k", "s/kg^1/2", "their input, P"),
            ("WHERE/block", "p, p", "1/s", "block of real states, T"),
            ("WHERE/block_output", "r, p", "kg^-1/2", "its output"),
            ("WHERE/block_input", "p, k", "s/kg^1/2", "its input"),
            ("WHERE/momentum", "3, q", "kg^1/2", "momentum that each state's rate carries"),
            ("WHERE/block_momentum", "3, p", "kg^1/2", "the same of the block"),
            ("WHERE/residual", "r, k", "m/N", "residual flexibility, by which it responds at once"),
            ("WHERE/static_flexibility", "r, k", "m/N", "static flexibility, all of it"),
            ("WHERE/left_out", "3, k", "kg m/N", "momentum of the motions outside the states"),
            ("WHERE/moments", "r", "-", "1 of outputs that are moments of the hub"),
            ("WHERE/slope", "6, k", "m s, s", "response to the rate of a force, where states are made static"),
            ("contact/index", "c", "-", "nodes of the outer face that carry the contact points"),
            ("attached/PART", "", "as modes.h5 and rotating.h5", "modes with attachment modes, for the energy"),
        ),
        "contact.h5": (
            ("time", "nt", "s", "end of each step"),
            ("points", "c, 3", "m", "contact points"),
            ("area", "c", "m2", "area that belongs to each"),
            ("normal_force", "nt, c", "N", "vertical force of the road on each point"),
            ("horizontal_force", "nt, c, 2", "N", "horizontal force, of the road's slope and of friction"),
            ("total_force", "nt, 3", "N", "their sums"),
            ("displacement", "nt, c", "m", "vertical displacement from the static state"),
            ("gap", "nt, c", "m", "height over the road"),
            ("active", "nt", "-", "points that touch"),
            ("residual", "nt", "-", "complementarity residual of the step"),
            ("axle_force", "nt, 3", "N", "force of the tire on the axle, or on the hub of a wheel that moves"),
            ("hub_moment", "nt, 3", "N m", "moment about the centre of the axle"),
            ("static_force", "c", "N", "normal force of the settled points in the static state"),
            ("static_horizontal_force", "c, 2", "N", "horizontal force of a static state with friction"),
            ("initial_normal_force", "c", "N", "normal force of steady rolling, with which the loop begins"),
            ("initial_horizontal_force", "c, 2", "N", "horizontal force of steady rolling"),
            ("driven_displacement", "nt, k, 3", "m", "displacement at the prescribed forces"),
            ("wheel/translation", "nt, 3", "m", "motion of a wheel that moves"),
            ("wheel/rotation", "nt, 3", "rad", "its rotation"),
            ("body/height", "nt", "m", "motion of the body"),
            ("road/wavelength", "w", "m", "third octaves of wavelength along the road's middle"),
            ("road/texture_level", "w", "dB re 1 um", "texture level (ISO 13473-4)"),
            ("pattern/s", "i", "m", "places around the tire of the tread pattern"),
            ("pattern/y", "j", "m", "places across it"),
            ("pattern/depth", "i, j", "m", "depth of its grooves"),
            ("pattern/begun", "", "m", "place under the points as the loop begins"),
        ),
        "accuracy.h5": (
            ("centre", "b", "Hz", "third octaves"),
            ("FORCE/CAUSE/mean", "3", "N", "error of the mean of `contact_force` or `axle_force` by one cause"),
            ("FORCE/CAUSE/deviation", "3", "N", "error of the standard deviation"),
            ("FORCE/CAUSE/history", "3", "-", "relative L2 norm of the error of the varying part"),
            ("FORCE/CAUSE/level", "b, 3", "dB", "error of the third octaves"),
            ("contact_force_mean", "3", "N", "mean of the contact force in the window"),
            ("axle_force_mean", "3", "N", "mean of the axle force in the window"),
        ),
        "stretches.h5": (
            ("contact_force", "r, n, 3", "N", "force of further stretches of road on the tire, after their run-in"),
            ("axle_force", "r, n, 3", "N", "force on the axle on these"),
            ("hub_moment", "r, n, 3", "N m", "moment about the centre of the axle"),
            ("driven_displacement", "r, n, k, 3", "m", "displacement at the prescribed forces"),
        ),
        "response.h5": (
            ("time", "nt", "s", "end of each step"),
            ("force", "nt, k", "N", "prescribed forces"),
            ("displacement", "nt, k, 3", "m", "displacement at the driven points"),
            ("axle_force", "nt, 3", "N", "force on the axle"),
            ("hub_moment", "nt, 3", "N m", "moment about the centre of the axle"),
            ("frequency", "f", "Hz", "frequencies of the receptance"),
            ("receptance", "f, k, k", "m/N", "displacement along each force per force, complex"),
            ("direct/frequency", "f", "Hz", "frequencies of the full matrices"),
            ("direct/receptance", "f, k, k", "m/N", "receptance by the full matrices"),
            ("impulse", "nt, k, k", "m/(N s)", "impulse response"),
            ("impulse_at_once", "k, k", "m/N", "weight of its delta(t)"),
            ("transmissibility/frequency", "f", "Hz", "frequencies"),
            ("transmissibility/momentum", "f, 3, k", "-", "force on the held axle per force, by momentum"),
            ("transmissibility/free_rim", "f, 3, k", "-", "the same by modes of a free rim"),
            ("transmissibility/moment", "f, 3, k", "m", "moment about the axle's centre per force"),
            ("transmissibility/free_rim_moment", "f, 3, k", "m", "the same by modes of a free rim"),
        ),
        "spectra.h5": (
            ("frequency", "f", "Hz", "spectral lines"),
            ("axle_force", "f, 3", "N", "complex amplitudes of the axle force, Hann window"),
            ("contact_force", "f, 3", "N", "complex amplitudes of the contact force"),
            ("hub_moment", "f, 3", "N m", "complex amplitudes of the moment"),
            ("wheel/translation", "f, 3", "m", "complex amplitudes of a wheel that moves"),
            ("wheel/rotation", "f, 3", "rad", "of its rotation"),
            ("body/height", "f, 1", "m", "of the body"),
            ("third_octave/centre", "b", "Hz", "exact middle frequencies"),
            ("third_octave/nominal", "b", "Hz", "nominal ones"),
            ("third_octave/lines", "b", "-", "spectral lines in a band, by share"),
            ("third_octave/freedom", "b", "-", "degrees of freedom of a level, by its lines in all windows"),
            ("third_octave/confidence", "b, 2", "dB", "bounds of the level of the stationary process, 95 %, by these"),
            ("third_octave/windows", "r", "-", "windows of the run's own record, and of each further stretch"),
            ("third_octave/too_narrow", "i", "Hz", "bands without a level: fewer than three lines"),
            ("third_octave/level", "b, 3", "dB re 1 N", "level of the axle force"),
            ("third_octave/level_a_weighted", "b, 3", "dB(A) re 1 N", "the same, A-weighted"),
            ("third_octave/level_error", "b, 3", "dB", "its estimated error; NaN where unknown"),
            ("third_octave/level_spread", "b, 3, 2", "dB", "bounds of the level, 95 %, by the spread of the windows"),
            ("third_octave/contact_level", "b, 3", "dB re 1 N", "level of the contact force"),
            ("third_octave/contact_level_a_weighted", "b, 3", "dB(A) re 1 N", "the same, A-weighted"),
            ("third_octave/contact_level_error", "b, 3", "dB", "its estimated error; NaN where unknown"),
            ("third_octave/contact_level_spread", "b, 3, 2", "dB", "bounds of the level by the spread of the windows"),
            ("third_octave/hub_moment_level", "b, 3", "dB re 1 N m", "level of the moment"),
            ("third_octave/hub_moment_level_a_weighted", "b, 3", "dB(A) re 1 N m", "the same, A-weighted"),
            ("third_octave/hub_moment_level_spread", "b, 3, 2", "dB", "bounds of the level by the spread of the windows"),
            ("third_octave/point_velocity_level", "b, k, 3", "dB re 1 nm/s", "level of the velocity at driven points"),
            ("third_octave/point_velocity_level_a_weighted", "b, k, 3", "dB(A) re 1 nm/s", "the same, A-weighted"),
            ("third_octave/point_velocity_level_spread", "b, k, 3, 2", "dB", "bounds by the spread of the windows"),
            ("density/frequency", "f", "Hz", "frequencies of power spectral densities, Welch's method"),
            ("density/segment", "", "s", "length of a segment"),
            ("density/averages", "", "-", "number of segments"),
            ("density/confidence", "2", "dB", "bounds, 95 %"),
            ("density/axle_force", "f, 3", "N2/Hz", "one-sided density of the axle force"),
            ("density/contact_force", "f, 3", "N2/Hz", "of the contact force"),
            ("density/hub_moment", "f, 3", "N2 m2/Hz", "of the moment"),
            ("density/point_velocity", "f, k, 3", "m2/s2/Hz", "of the velocity at driven points"),
        ),
        "vibration.h5": (
            ("frequency", "f", "Hz", "spectral lines"),
            ("mean_square_velocity", "f", "m2/s2", "mean square normal velocity of the outer face"),
            ("third_octave/centre", "b", "Hz", "third octaves"),
            ("third_octave/velocity_level", "b", "dB re 1 nm/s", "velocity level"),
            ("third_octave/velocity_level_a_weighted", "b", "dB(A) re 1 nm/s", "the same, A-weighted"),
            ("third_octave/radiated_power_level", "b", "dB re 1 pW", "equivalent radiated power"),
            ("third_octave/radiated_power_level_a_weighted", "b", "dB(A) re 1 pW", "the same, A-weighted"),
            ("surface/frequency", "g", "Hz", "lines whose shapes are stored"),
            ("surface/displacement", "g, s, 3", "m", "complex amplitudes"),
            ("surface/points", "s, 3", "m", "nodes of the outer face"),
        ),
        "radiation.h5": (
            ("frequency", "f", "Hz", "solved frequencies"),
            ("microphones", "k, 3", "m", "x forward, y left along the axle, z over the road under the axle"),
            ("near", "f, k, e", "1/m", "Green's functions from elements to microphones, g e^{ikR}"),
            ("far", "f, d, e", "1/m", "the same to the directions of a hemisphere"),
            ("coarse", "f, k, e", "1/m", "to microphones, from elements of twice the size"),
            ("error_of_sources_inside", "k, f", "dB", "error for sources inside the tire"),
        ),
        "sound.h5": (
            ("frequency", "f", "Hz", "spectral lines"),
            ("microphones", "k, 3", "m", "places of the microphones"),
            ("pressure", "k, f", "Pa", "complex amplitudes for e^{+iwt}, Hann window"),
            ("third_octave/centre", "b", "Hz", "third octaves"),
            ("third_octave/level", "k, b", "dB re 20 uPa", "sound pressure level"),
            ("third_octave/level_a", "k, b", "dB(A) re 20 uPa", "the same, A-weighted"),
            ("third_octave/level_error", "k, b", "dB", "its estimated error; NaN where unknown"),
            ("third_octave/element_error", "k, b", "dB", "the part of it that the boundary elements have"),
            ("third_octave/intensity_level_a", "i, b", "dB(A) re 1 pW/m2", "A-weighted intensity level of each probe, outward; NaN where the intensity is inward"),
            ("intensity", "i, f", "W/m2", "outward active intensity at the intensity probes (attribute `names`), Hann window"),
            ("intensity_index", "i, b", "dB", "pressure-intensity index of the probes in third octaves"),
            ("total/intensity_level_a", "i", "dB(A) re 1 pW/m2", "A-weighted intensity level of all lines"),
            ("power", "b", "dB re 1 pW", "sound power level"),
            ("efficiency", "b", "-", "radiation efficiency"),
            ("total/level", "k", "dB re 20 uPa", "level of all lines"),
            ("total/level_a", "k", "dB(A) re 20 uPa", "the same, A-weighted"),
            ("total/level_error", "k", "dB", "its error; NaN where unknown"),
            ("total/level_a_error", "k", "dB", "the same of the A-weighted level"),
            ("total/power", "2", "dB re 1 pW", "sound power level of all lines, and A-weighted"),
            ("directivity/elevation", "d", "deg", "elevations of the hemisphere"),
            ("directivity/azimuth", "a", "deg", "azimuths"),
            ("directivity/level", "b, d, a", "dB re 20 uPa at 7.5 m", "level in each direction"),
            ("signal/pressure", "k, n", "Pa", "sound pressure over time, at the attribute `rate` in Hz"),
            ("transfer/frequency", "g", "Hz", "frequencies of the transfer functions"),
            ("transfer/weight", "g, k, s", "Pa s/m3", "pressure per volume velocity of each node of the outer face"),
            ("contribution/region", "k, b, r", "-", "share of each region in the mean square pressure"),
            ("contribution/element", "k, b, e", "-", "share of each element"),
            ("contribution/outline", "e, 4, 2", "deg, -", "corners of the elements around and along the section"),
        ),
        "motion.h5": (
            ("time", "g", "s", "instants"),
            ("displacement", "g, s, 3", "m", "motion of the outer face from the static state"),
            ("surface/points", "s, 3", "m", "its nodes"),
        ),
    }.items()
}  # fmt: skip


@cache
def _pattern(name: str) -> re.Pattern[str]:
    parts = [STANDS_FOR.get(part, re.escape(part)) for part in name.split("/")]
    return re.compile("/".join(parts))


def declared(file: str, name: str) -> Dataset | None:
    """The declaration of a dataset in a result file; None if there is none."""
    return next((row for row in DATASETS.get(file, ()) if _pattern(row.name).fullmatch(name)), None)


def page() -> Iterator[str]:
    """Lines of Markdown: a table for each file."""
    for file, rows in DATASETS.items():
        yield from (
            "",
            f"### {file}",
            "",
            "| dataset | shape | unit | meaning |",
            "|---|---|---|---|",
        )
        for row in rows:
            meaning = row.meaning.replace("|", "\\|")
            yield f"| `{row.name}` | {row.shape or 'one'} | {row.unit} | {meaning} |"
