"""Faults by the keys of a scenario's `faults`."""

from pydantic import ValidationError

from gcs.errors import BadInput
from mavlink_defs.config.files import problems_of
from mavlink_defs.fault_spec import FaultSpec
from mavlink_defs.faults import Fault


def fault_of(actuator: str, start_s: float | None = None, **keys: float) -> Fault:
    """Return a fault as a command sets it.

    Args:
        actuator: Its name.
        start_s: Start in simulated time, exclusive; None for now [s].
        **keys: Such as `effectiveness`, `bias_deg`, `stuck_deg`, `drift_deg_s`, `frequency_hz`,
            `end_s`.

    Raises:
        BadInput: They do not describe a fault.
    """
    try:
        return FaultSpec.model_validate(
            {"actuator": actuator, "start_s": start_s, **keys}
        ).command()
    except ValidationError as error:
        raise BadInput("; ".join(map(str, problems_of(FaultSpec, error)))) from None
