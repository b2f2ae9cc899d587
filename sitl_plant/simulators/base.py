"""What a simulator of one aircraft has to offer, so that the plant, and identification, can fly it.

A further simulator is one file in any package: a class with these methods, and its registration in
the group of entry points `ftc_sitl.simulators`.
"""

from typing import NamedTuple, Protocol, runtime_checkable

from sitl_plant.airframe.config import Inertia
from sitl_plant.vec3 import Vec3


class SimulatorError(Exception):
    """A simulator cannot fly, or cannot fly on; the text says why.

    Attributes:
        hint: What to do about it; may be empty.
    """

    def __init__(self, text: str, hint: str = "") -> None:
        super().__init__(text)
        self.hint = hint


class Motion(NamedTuple):
    """Where an aircraft is and what it feels; body axes are x forward, y right, z down."""

    position: Vec3  # north, east, down [m]
    velocity: Vec3  # over the ground, body axes [m/s]
    attitude: Vec3  # roll, pitch, yaw [rad]; yaw may go on beyond ±pi
    rates: Vec3  # angular velocity, body axes [rad/s]
    specific_force: Vec3  # (force - weight) / mass at the centre of gravity, body axes [m/s²]
    load: float = 0.0  # of the ground on its wheels, as a share of its weight


class Body(NamedTuple):
    """What a simulator says about its aircraft, as it is loaded."""

    mass_kg: float
    inertia_kg_m2: Inertia
    wing_area_m2: float
    wing_span_m: float
    mean_chord_m: float
    air_density_kg_m3: float  # at the altitude it starts from


class Simulator(Protocol):
    """One aircraft in another flight dynamics model. SI units, angles in rad."""

    body: Body
    stops: tuple[tuple[float, float], ...]
    """Least and largest deflection of aileron, elevator, rudder [rad]; shape (3, 2).

    The signs are the plant's: cl_da, cm_de and cn_dr are negative.
    """

    def reset(self, motion: Motion) -> None:
        """Put the aircraft somewhere, its surfaces where `control` last put them."""

    def control(self, delta: Vec3, thrust: float) -> None:
        """Put aileron, elevator and rudder [rad] and the thrust along x [N] where they are to be.

        The servos are the plant's, and have moved already.
        """

    def set_wind(self, wind: Vec3) -> None:
        """Set the velocity of the air, north, east, down [m/s]."""

    def advance(self, dt: float) -> None:
        """Advance by a time [s], a multiple of its own step."""

    def read(self) -> Motion:
        """Return the present motion."""


@runtime_checkable
class GroundSimulator(Simulator, Protocol):
    """One that has the ground, at down = 0, and wheels: what an aircraft with `gear` takes."""

    def stand(self, north_m: float, east_m: float, yaw: float) -> Motion:
        """Put the aircraft at rest on its wheels, with a heading [rad]; return its motion."""

    def brake(self, share: float) -> None:
        """Put the wheels' brakes at a share, 0 to 1, of what they can."""
