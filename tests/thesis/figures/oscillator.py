"""Figure D.1: the Green's function of an oscillator with one degree of freedom."""

from __future__ import annotations

import numpy as np

from tireroad.greens.response import Response, couple
from tireroad.modal.rotating import rotating
from tireroad.tests.thesis.claim import Claim
from tireroad.tests.thesis.figure import Reproduced, figure
from tireroad.tests.thesis.plots import Curve, Panel, lines
from tireroad.tests.thesis.runner import Scenes

# (D.4) and (D.5) as printed: u, eigenvalue, a for each of the two terms.
PRINTED = (
    (-0.56 - 0.44j, -0.50 + 0.87j, -0.85 + 0.22j),
    (-0.56 + 0.44j, -0.50 - 0.87j, -0.85 - 0.22j),
)
SECOND = 0.50 - 0.87j  # second eigenvalue as printed in (D.4)
DIGITS = 0.03  # error of u u/a in (D.5), printed to two digits
TIMES = np.linspace(0.0, 12.0, 481)  # s


@figure(
    "figure-D.1",
    "Green's function of u'' + u' + u = F",
    "A decaying wave from two eigenvalues, -0.50 + 0.87i and (printed) 0.50 - 0.87i; its Green's function is (D.5).",
)
def oscillator(scenes: Scenes) -> Reproduced:
    """By the program's own quadratic eigenproblem. Not collective."""
    one = np.ones((1, 1))
    response: Response = couple(rotating(one, one), one, one, np.ones((3, 1)))
    found = response.impulse(TIMES)[:, 0, 0]
    printed = sum((u * u / a * np.exp(s * TIMES) for u, s, a in PRINTED), np.zeros(1)).real
    exact = np.exp(-TIMES / 2) * np.sin(np.sqrt(0.75) * TIMES) / np.sqrt(0.75)
    s, second = response.eigenvalue[0], response.eigenvalue[0].conj()
    return Reproduced(
        shows=f"Eigenvalues {s.real:.4f} ± {s.imag:.4f}i 1/s; the largest displacement after a unit impulse is {found.max():.4f} m.",
        claims=_claims(s, second, found, printed, exact),
        picture=lambda: lines(
            [
                Panel(
                    x="time in s",
                    y="g in m/(N s)",
                    curves={
                        "this program": Curve(TIMES, found),
                        "thesis, (D.5) as printed": Curve(TIMES, printed, 1, "--"),
                    },
                )
            ]
        ),
        caption="The two curves lie on each other but for the two digits to which (D.5) is printed.",
    )


def _claims(
    s: complex, second: complex, found: np.ndarray, printed: np.ndarray, exact: np.ndarray
) -> tuple[Claim, ...]:
    root = np.sqrt(0.75)
    return (
        Claim(
            what="first eigenvalue, real part",
            unit="1/s",
            thesis=PRINTED[0][1].real,
            source="(D.4)",
            found=s.real,
            tolerance=0.01,
            right=-0.5,
            by="roots of s² + s + 1",
        ),
        Claim(
            what="first eigenvalue, imaginary part",
            unit="1/s",
            thesis=PRINTED[0][1].imag,
            source="(D.4)",
            found=s.imag,
            tolerance=0.01,
            right=root,
            by="roots of s² + s + 1",
        ),
        Claim(
            what="second eigenvalue, real part",
            unit="1/s",
            thesis=SECOND.real,
            source="(D.4)",
            found=second.real,
            tolerance=0.01,
            right=-0.5,
            by="roots of s² + s + 1",
            because="of a sign that is lost in print: (D.5) itself decays by both eigenvalues, and a pair of real matrices is conjugate",
        ),
        Claim(
            what="largest value of the Green's function",
            unit="m/(N s)",
            thesis=float(printed.max()),
            source="(D.5) evaluated",
            found=float(found.max()),
            tolerance=DIGITS,
            right=float(exact.max()),
            by="e^(-t/2) sin(√¾ t)/√¾",
        ),
        Claim(
            what="largest distance from (D.5) as printed",
            unit="m/(N s)",
            thesis=0.0,
            source="(D.5), figure D.1",
            found=float(np.abs(found - printed).max()),
            tolerance=0.02,
        ),
    )
