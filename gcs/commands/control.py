"""``gcs arm``, ``gcs disarm``, ``gcs start``, ``gcs mode``."""

from typing import Annotated, Literal

import typer

from gcs.commands.station import StationOptions, station_command


@station_command
def arm(station: StationOptions) -> None:
    """Arm vehicles; time begins when the whole fleet is armed.

    Examples:
        - gcs arm
        - gcs arm --uav 1,3 --json
    """
    station.do(lambda vehicle: vehicle.arm(), "armed")


@station_command
def disarm(
    station: StationOptions, force: Annotated[bool, typer.Option("--force")] = False
) -> None:
    """Disarm vehicles; in flight they refuse unless forced.

    Args:
        force: Disarm even in flight: control and thrust end.

    Examples:
        - gcs disarm
        - gcs disarm --uav 2 --force
    """
    station.do(lambda vehicle: vehicle.disarm(force), "disarmed")


@station_command
def start(station: StationOptions) -> None:
    """Start flying the mission.

    It starts at once in flight, else when simulated time begins.

    Examples:
        - gcs start && gcs arm          (the mission begins with simulated time)
        - gcs start --uav 1
    """
    station.do(lambda vehicle: vehicle.start_mission(), "started its mission")


@station_command
def mode(
    station: StationOptions,
    name: Annotated[Literal["auto", "loiter", "rtl", "guided"], typer.Argument(metavar="MODE")],
) -> None:
    """Change the mode: fly the mission, circle, or follow targets.

    `loiter` circles here, `rtl` at home; `guided` follows the targets of a station.

    Args:
        name: auto, loiter, rtl or guided

    Examples:
        - gcs mode loiter
        - gcs mode auto --uav 2
        - gcs mode rtl
    """
    station.do(lambda vehicle: vehicle.set_mode(name.upper()), f"in mode {name.upper()}")
