"""Identities on the wire that several packages share."""

from mavlink_defs.dialect import FTC_ACTUATOR_THROTTLE, MAV_COMP_ID_USER1

__all__ = ["N_CHANNELS", "SIMULATOR_COMPONENT", "THROTTLE"]

N_CHANNELS = 4
"""Actuator channels, in the order of FTC_ACTUATOR: aileron, elevator, rudder, throttle."""

THROTTLE = FTC_ACTUATOR_THROTTLE
"""The channel of the thrust; the others are surfaces."""

SIMULATOR_COMPONENT = MAV_COMP_ID_USER1
"""Component id of an aircraft inside the plant; its system id is the UAV's."""
