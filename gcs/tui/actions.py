"""The actions that every panel has."""

from gcs.station.vehicle import Vehicle
from gcs.tui.formatting import ids
from gcs.tui.requests import Answer, VehicleAction
from mavlink_defs.constants import MODE_NAMES


def arm(systems: tuple[int, ...]) -> VehicleAction:
    """Arm, after a question: when all are armed time begins."""
    question = f"Arm {ids(systems)}?\nSimulated time begins for all when the last UAV is armed."
    return VehicleAction("arm", systems, lambda vehicle, _: vehicle.arm(), question=question)


def start_mission(systems: tuple[int, ...]) -> VehicleAction:
    """Start to fly the profile."""
    return VehicleAction("start mission", systems, lambda vehicle, _: vehicle.start_mission())


def disarm(systems: tuple[int, ...]) -> VehicleAction:
    """Disarm, by force if the operator chooses that."""

    async def act(vehicle: Vehicle, choice: str) -> str:
        await vehicle.disarm(force=choice == "force")
        return "disarmed by force" if choice == "force" else ""

    question = (
        f"Disarm {ids(systems)}?\nVehicles in flight refuse, unless forced: then the "
        "controller stops and the thrust goes to zero for good."
    )
    choices = (Answer("Disarm", "", "warning"), Answer("Force: no thrust", "force", "error"))
    return VehicleAction("disarm", systems, act, question=question, choices=choices)


def change_mode(systems: tuple[int, ...]) -> VehicleAction:
    """Change to the mode that the operator chooses."""

    async def act(vehicle: Vehicle, choice: str) -> str:
        await vehicle.set_mode(choice)
        return f"mode {choice}"

    choices = tuple(Answer(mode, mode) for mode in MODE_NAMES.values())
    return VehicleAction("mode", systems, act, question=f"Mode of {ids(systems)}?", choices=choices)
