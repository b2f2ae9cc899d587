"""The faults of an aircraft of the plant, for its simulator component."""

from mavlink_defs.faults.aircraft import AircraftFaults
from mavlink_defs.faults.kinds import FaultLimits
from sitl_plant.loop.fleet import PlantState, fault_tables


def faults_of(fleet: PlantState, i: int, limits: FaultLimits) -> AircraftFaults:
    """Return the faults of aircraft i, whose actuators have these limits."""
    return AircraftFaults(fault_tables(fleet, i), limits, fleet.uavs[i]["applied"])
