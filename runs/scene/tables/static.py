"""The table [static]: inflation, and the road by load, deflection or height."""

from dataclasses import dataclass

from tireroad.runs.scene.schema import flag, integer, number


@dataclass(frozen=True)
class Static:
    inflation: float = number(
        2.0e5, "Pa", "inflation pressure on the inner face", least=0, most=1e8
    )
    load: float | None = number(
        None, "N", "vertical load of the tire on the road", least=1e-3, most=1e8
    )
    deflection: float | None = number(
        None,
        "m",
        "deflection from the first touch of the inflated tire, instead of load",
        least=1e-6,
        most=10,
    )
    road_height: float | None = number(
        None,
        "m",
        "z of the road under the axle, the axle at 0, instead of load",
        least=-10,
        most=-1e-3,
    )
    camber: float = number(
        0.0,
        "deg",
        "inclination of the wheel on its road, load and deflection along the road's normal; > 0: its top leans to the "
        "right (-y)",
        least=-20,
        most=20,
    )
    friction: float | None = number(
        None,
        "-",
        "coefficient of Coulomb friction between tire and road in the static state; absent: none. A standing tire sticks "
        "and slips as it is pressed on the road, a rolling one as its tread passes through the contact, with a wheel "
        "that turns as it would roll freely without contact.slip and rotation.slip_angle",
        least=0,
        most=10,
    )
    friction_steps: int = integer(
        10,
        "steps in which a standing tire with friction is pressed on the road",
        least=1,
        most=1000,
    )
    steady_rolling: bool = flag(
        True,
        "include the inertia and material damping of the rolling shape; false: the state at rest",
    )
    error_estimate: bool = flag(
        True,
        "estimate the discretisation error of the load, by finer elements at the footprint, which also give its extent, "
        "and by elements of another order everywhere",
    )

    @property
    def on_road(self) -> bool:
        """Whether there is a road."""
        return (self.load, self.deflection, self.road_height) != (None, None, None)
