"""Identities on the wire that several packages share."""

from mavlink_defs.dialect import MAV_COMP_ID_USER1

__all__ = ["SIMULATOR_COMPONENT"]

SIMULATOR_COMPONENT = MAV_COMP_ID_USER1
"""Component id of an aircraft inside the plant; its system id is the UAV's."""
