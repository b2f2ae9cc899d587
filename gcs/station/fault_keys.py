"""Faults by the keys of a scenario's `faults`."""

from pydantic import ValidationError

from gcs.errors import BadInput
from mavlink_defs.config.files import problems_of
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.spec import ActuatorFaultSpec, FaultSpec, SensorFaultSpec


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
    return _fault(ActuatorFaultSpec, actuator=actuator, start_s=start_s, **keys)


def sensor_fault_of(sensor: str, failure: str | None = None, **keys: float | str | None) -> Fault:
    """Return a fault of a sensor as a command sets it.

    Args:
        sensor: Its name.
        failure: As of MAV_CMD_INJECT_FAILURE; None if a value says it.
        **keys: Such as `instance`, `axis`, `bias_deg_s`, `fade_s`, `noise_factor`, `start_s`,
            `end_s`.

    Raises:
        BadInput: They do not describe a fault.
    """
    return _fault(SensorFaultSpec, sensor=sensor, failure=failure, **keys)


def _fault(spec: type[FaultSpec], **keys: float | str | None) -> Fault:
    try:
        return spec.model_validate(keys).command()
    except ValidationError as error:
        raise BadInput("; ".join(map(str, problems_of(spec, error)))) from None
