"""What flies the aircraft: the plant's own equations, JSBSim, or a simulator of another package."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag

from mavlink_defs.config.models import AtMost, Loc, Model, Title
from mavlink_defs.config.quantity import quantity, whole


class OwnPlant(Model):
    """The plant's own equations fly the scenario's aircraft.

    Attributes:
        kind: The plant's own equations.
    """

    kind: Literal["own"] = "own"


def _form(value: object) -> str | None:
    """Return the tag of a number, or of a text."""
    if isinstance(value, str):
        return "<text>"
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return "<number>" if number else None


_Replaced = Annotated[
    Annotated[float, quantity("", "In the unit that the element names."), Tag("<number>")]
    | Annotated[Title, Tag("<text>")],
    Discriminator(_form),
]


def is_own(aircraft: str) -> bool:
    """Return whether the name of an aircraft is a folder or a file, not one that JSBSim has."""
    return "/" in aircraft or aircraft.endswith(".xml")


class JsbSimPlant(Model):
    """JSBSim flies an aircraft of its own; the scenario's is the nominal one.

    Attributes:
        kind: JSBSim.
        aircraft: One that comes with JSBSim, such as c172p, or one's own: a folder ./NAME with
            NAME.xml in it, or the file.
        thrust: A force along x at the centre of gravity, or JSBSim's engine by its throttle.
        step_us: Step of JSBSim; none: the control period.
        patch: Elements of the file to change, or an attribute (@unit) of one: path under
            fdm_config, and the new value.
    """

    kind: Literal["jsbsim"]
    aircraft: Title = Field(min_length=1)
    thrust: Literal["force", "engine"] = "force"
    step_us: int | None = whole("us", default=None, ge=1, le=100_000)
    patch: Annotated[dict[str, _Replaced], AtMost(100)] = Field(default={})


class PluginPlant(Model):
    """A simulator of another package, which registers it in the group ftc_sitl.simulators.

    Attributes:
        kind: A simulator of another package.
        name: Name under which it is registered.
        step_us: Its step; none: the control period.
        options: What it takes, as its documentation says.
    """

    kind: Literal["plugin"]
    name: Title = Field(min_length=1)
    step_us: int | None = whole("us", default=None, ge=1, le=100_000)
    options: Annotated[dict[str, Any], AtMost(100)] = Field(default={})


def _kind(value: Any) -> Any:
    if isinstance(value, dict):
        return value.get("kind", "own")
    return getattr(value, "kind", "own")


PlantSection: TypeAlias = Annotated[
    Annotated[OwnPlant, Tag("own")]
    | Annotated[JsbSimPlant, Tag("jsbsim")]
    | Annotated[PluginPlant, Tag("plugin")],
    Discriminator(_kind),
]
"""What flies the aircraft, discriminated by `kind`."""


def plant_problems(plant: PlantSection, step_us: int) -> Iterator[tuple[Loc, str]]:
    """Yield place and text if a simulator's step does not divide the control period [µs]."""
    if not isinstance(plant, OwnPlant) and plant.step_us and step_us % plant.step_us != 0:
        text = f"expected a divisor of the control period of {step_us} us, got {plant.step_us}"
        yield ("plant", "step_us"), text
