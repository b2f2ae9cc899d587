"""Faults by the keys of a scenario's `faults`."""

from pydantic import ValidationError

from gcs.errors import BadInput
from mavlink_defs.config.files import problems_of
from mavlink_defs.fault_spec import FaultSpec
from mavlink_defs.faults import Fault
from mavlink_defs.sensor_fault_spec import SensorFaultSpec
from mavlink_defs.sensor_faults import SensorFault


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


def sensor_fault_of(
    sensor: str,
    failure: str | None = None,
    *,
    instance: int = 0,
    axis: str | None = None,
    start_s: float | None = None,
    **keys: float,
) -> SensorFault:
    """Return a fault of a sensor as a command sets it.

    Args:
        sensor: Its name.
        failure: As of MAV_CMD_INJECT_FAILURE; None if a value says it.
        instance: Number of the sensor from 1; 0 for all.
        axis: Axis that is wrong; None for all.
        start_s: Start in simulated time, exclusive; None for now [s].
        **keys: Such as `bias_deg_s`, `fade_s`, `noise_factor`, `end_s`.

    Raises:
        BadInput: They do not describe a fault.
    """
    given = {"failure": failure, "instance": instance, "axis": axis, "start_s": start_s}
    try:
        return SensorFaultSpec.model_validate({"sensor": sensor, **given, **keys}).command()
    except ValidationError as error:
        raise BadInput("; ".join(map(str, problems_of(SensorFaultSpec, error)))) from None
