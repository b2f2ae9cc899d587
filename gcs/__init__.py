"""Ground station: scenarios, fleets, MAVLink client, command line, dashboard, reports.

What programs use is here; each name is imported when it is first used::

    from gcs import fly

    flight = fly("paper/scenario1", {"controller.kind": "surviving"})
    flight.frame()
    flight.plot()
"""

TYPE_CHECKING = False  # as of `typing`, whose import the command line cannot wait for

if TYPE_CHECKING:
    from gcs.api.campaigns import campaign
    from gcs.api.flight import Flight, open_run
    from gcs.api.flying import fly, fly_many
    from gcs.api.station import Station, Uav, connect
    from gcs.console.errors import BadInput, CommandRefused, FlightLost, GcsError, NoAnswer
    from gcs.scenario.model import Scenario, load_scenario

__all__ = [
    "BadInput",
    "CommandRefused",
    "Flight",
    "FlightLost",
    "GcsError",
    "NoAnswer",
    "Scenario",
    "Station",
    "Uav",
    "campaign",
    "connect",
    "fly",
    "fly_many",
    "load_scenario",
    "open_run",
]

_HOMES = {
    "gcs.api.campaigns": ("campaign",),
    "gcs.api.flight": ("Flight", "open_run"),
    "gcs.api.flying": ("fly", "fly_many"),
    "gcs.api.station": ("Station", "Uav", "connect"),
    "gcs.console.errors": ("BadInput", "CommandRefused", "FlightLost", "GcsError", "NoAnswer"),
    "gcs.scenario.model": ("Scenario", "load_scenario"),
}

if not TYPE_CHECKING:  # a type checker knows all names, and no others

    def __getattr__(name: str) -> object:
        from importlib import import_module

        for home, names in _HOMES.items():
            if name in names:
                found = globals()[name] = getattr(import_module(home), name)
                return found
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
