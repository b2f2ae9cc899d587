"""Configuration of the plant: initial states, disturbances, air, sensors, the link.

The aircraft themselves are in `sitl_plant.airframe.config`.
"""

from collections.abc import Iterator
from typing import Annotated

from pydantic import Field, model_validator

from mavlink_defs.config.models import HostPort, Loc, Model, Problems, SystemId, repeated
from mavlink_defs.config.quantity import quantity, whole
from mavlink_defs.origin import Origin
from sitl_plant.actuators.config import ActuatorServos, servo_problems
from sitl_plant.air.config import Disturbance, Wind
from sitl_plant.airframe.config import Aircraft, Uncertainty
from sitl_plant.airframe.gear import Ground, Runway
from sitl_plant.sensing.config import Navigation, Sensors
from sitl_plant.sensing.observability import navigation_problems, sensor_problems
from sitl_plant.simulators.config import OwnPlant, PlantSection, plant_problems


def truth_problems(
    plant: PlantSection, disturbance: Disturbance, uncertainty: Uncertainty, ground: Ground
) -> Iterator[tuple[Loc, str]]:
    """Yield place and text of what changes the plant's own equations, which a simulator has not."""
    sections = (("disturbance", disturbance), ("uncertainty", uncertainty), ("ground", ground))
    for name, given in sections:
        if given != type(given)():
            text = "changes the plant's own equations, but plant.kind is"
            yield (name,), f"{text} {plant.kind!r}: leave it out (null removes a base's)"


class InitialState(Model):
    """State at t = 0: v = [V, 0, 0] through the air, no rotation; or at rest on the ground.

    Attributes:
        north_m: North.
        east_m: East.
        on_ground: Whether it stands at rest on its wheels or launcher, in place of altitude,
            airspeed, roll and pitch.
        altitude_m: Height above the origin.
        airspeed_m_s: Airspeed V.
        roll_deg: Roll angle.
        pitch_deg: Pitch angle.
        yaw_deg: Yaw angle.
    """

    north_m: float = quantity("m")
    east_m: float = quantity("m")
    on_ground: bool = Field(default=False, strict=True)
    altitude_m: float = quantity("m", default=0.0, ge=0.0)
    airspeed_m_s: float = quantity("m/s", default=0.0, ge=0.0)
    roll_deg: float = quantity("deg", default=0.0, ge=-180.0, le=180.0)
    pitch_deg: float = quantity("deg", default=0.0, gt=-89.0, lt=89.0)
    yaw_deg: float = quantity("deg", default=0.0, ge=-180.0, le=180.0)

    @model_validator(mode="after")
    def _where(self) -> "InitialState":
        keys = {"altitude_m": "m", "airspeed_m_s": "m/s"}
        if self.on_ground:
            text = "expected nothing of an aircraft that stands on the ground"
            set_by = self.model_fields_set & {*keys, "roll_deg", "pitch_deg"}
            zero = {name for name in set_by if getattr(self, name) == 0.0}
            Problems.check(
                ((name,), f"{text}, got {getattr(self, name)!r}") for name in sorted(set_by - zero)
            )
            return self
        Problems.check(
            ((name,), f"missing; expected a number in {unit}, or 'on_ground: true'")
            for name, unit in keys.items()
            if name not in self.model_fields_set
        )
        if self.airspeed_m_s == 0.0:
            text = "expected > 0 m/s, or 'on_ground: true', got 0.0"
            raise Problems([(("airspeed_m_s",), text)])
        return self


Seed = Annotated[int, whole("", "Seed of all that is random.", ge=0, le=2**32 - 1)]


class PlantUav(Model):
    """One aircraft of the plant.

    Attributes:
        initial: State at t = 0.
        aircraft: The true aircraft.
        servos: Its servos.
        plant: What flies it.
    """

    id: SystemId
    initial: InitialState
    aircraft: Aircraft
    servos: ActuatorServos = ActuatorServos()
    plant: PlantSection = OwnPlant()


def start_problems(
    initial: InitialState, aircraft: Aircraft, ground: Ground
) -> Iterator[tuple[Loc, str]]:
    """Yield why an aircraft cannot start where it is to."""
    gear = aircraft.gear
    if gear is None and initial.on_ground:
        text = "the aircraft has no gear to stand on: add `gear` to the aircraft"
        yield ("initial", "on_ground"), f"{text}, such as 'gear: {{kind: tricycle}}'"
    lowest = ground.altitude_m(initial.north_m, initial.east_m)
    if gear is not None:
        lowest += gear.main(aircraft.wing_span_m)[2]
    if not initial.on_ground and initial.altitude_m < lowest:
        text = f"expected >= {lowest:.4g} m, above the ground there with its wheels, or"
        yield ("initial", "altitude_m"), f"{text} 'on_ground: true', got {initial.altitude_m!r}"


class PlantConfig(Model):
    """All that the plant process needs.

    Attributes:
        step_us: Control period, and step of the integration.
        duration_s: Length of the flight; none: until stopped.
        speed: Real-time factor; none: lockstep.
        bind: Where the simulator link is received.
        signing_key: Key file; none: unsigned.
        silence_timeout_s: Silence after which an autopilot counts as gone.
        wait_for_restart: Wait for a silent autopilot instead of stopping.
        disturbance: Disturbances of every aircraft.
        wind: Motion of the air.
        ground: The ground.
        runway: A runway on it.
        sensors: Sensors of every aircraft.
        origin: Where north = east = down = 0 is.
        uavs: The aircraft.
    """

    step_us: int = whole("us", default=1000, ge=1, le=100_000)
    duration_s: float | None = quantity("s", default=None, gt=0.0, le=86_400.0)
    speed: float | None = quantity("", default=None, gt=0.0)
    bind: HostPort
    signing_key: str | None = None
    silence_timeout_s: float = quantity("s", default=5.0, gt=0.0)
    wait_for_restart: bool = Field(default=False, strict=True)
    disturbance: Disturbance = Disturbance()
    wind: Wind = Wind()
    ground: Ground = Ground()
    runway: Runway | None = None
    sensors: Sensors = Sensors()
    navigation: Navigation = "true_state"
    origin: Origin = Origin()
    seed: Seed = 1
    uavs: tuple[PlantUav, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _ids_unique(self) -> "PlantConfig":
        Problems.check(
            (("uavs", i, "id"), text) for i, text in repeated([uav.id for uav in self.uavs])
        )
        return self

    @model_validator(mode="after")
    def _starts_above_the_ground(self) -> "PlantConfig":
        Problems.check(
            (("uavs", i, *loc), text)
            for i, uav in enumerate(self.uavs)
            for loc, text in start_problems(uav.initial, uav.aircraft, self.ground)
        )
        return self

    @model_validator(mode="after")
    def _periods_fit(self) -> "PlantConfig":
        estimated = self.navigation == "estimated"
        cannot = navigation_problems if estimated else sensor_problems
        late = cannot(self.sensors, self.step_us)
        problems = [(("sensors", *loc), text) for loc, text in late]
        for i, uav in enumerate(self.uavs):
            slow = servo_problems(uav.servos, self.step_us)
            problems += [(("uavs", i, "servos", *loc), text) for loc, text in slow]
            steps = plant_problems(uav.plant, self.step_us)
            problems += [(("uavs", i, *loc), text) for loc, text in steps]
        for plant in [uav.plant for uav in self.uavs if not isinstance(uav.plant, OwnPlant)][:1]:
            problems += truth_problems(plant, self.disturbance, Uncertainty(), self.ground)
        Problems.check(problems)
        return self
