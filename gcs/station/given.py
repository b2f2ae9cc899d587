"""What users give to a vehicle: faults by the keys of a scenario, missions and profiles by file.

What reads it is imported when it is needed: commands that have nothing to read need not wait.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from gcs.console.errors import BadInput, python_errors
from gcs.station.mission import Mission
from mavlink_defs.faults.fault import Fault
from mavlink_defs.profile import Segment

if TYPE_CHECKING:
    from gcs.scenario.fence import Areas


def fault_of(**keys: object) -> Fault:
    """Return a fault of an `actuator` or a `sensor` as a command sets it.

    Raises:
        BadInput: The keys do not describe a fault.
    """
    from pydantic import ValidationError

    from mavlink_defs.config.files import problems_of
    from mavlink_defs.faults.spec import SPECS, FaultSpec

    model: type[FaultSpec] = SPECS[next(key for key in SPECS if key in keys)]
    try:
        return model.model_validate(keys).command()
    except ValidationError as error:
        raise BadInput("; ".join(map(str, problems_of(model, error)))) from None


def mission_of(file: Path | str) -> Mission:
    """Read a mission, home included, as `gcs mission upload` does.

    Raises:
        BadInput: The file cannot be used.
    """
    from gcs.scenario.itinerary import load_mission

    with python_errors():
        return load_mission(file)[0]


def areas_of(file: Path | str) -> "Areas":
    """Read fence and rally points of a plan or a scenario, which may have none.

    Raises:
        BadInput: The file cannot be used.
    """
    from gcs.scenario.itinerary import load_areas

    with python_errors():
        return load_areas(file)


def profile_of(file: Path | str) -> tuple[Segment, ...]:
    """Read a profile, as `gcs profile upload` does.

    Raises:
        BadInput: The file cannot be used.
    """
    from gcs.scenario.profile_file import load_profile

    with python_errors():
        return load_profile(file)
