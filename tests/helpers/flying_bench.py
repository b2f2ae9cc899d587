"""A vehicle with all its services that flies the plant's aircraft, in process."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from scenario_edits import edit
from vehicle_bench import ARM, START, Bench, of_type

from gcs.fleet import in_process
from gcs.scenario.model import scenario_of, scenario_tree
from sitl_plant.airframe.standing import contact_facts
from sitl_plant.loop.fleet import loss_of, observe

_LOOK_STEPS = 20


class FlyingBench(Bench):
    """A bench whose aircraft flies its mission, until commands of a test say otherwise.

    Attributes:
        loss: Why it was lost; None if it was not.
        told: Its STATUSTEXTs.
    """

    def __init__(self, name: str | Path, changes: Mapping[str, Any]) -> None:
        self.scenario = scenario_of(name, edit(scenario_tree(name), {"step_us": 4000, **changes}))
        super().__init__(self.scenario)
        begun = in_process.begin(self.scenario)
        self.flight = begun._replace(controllers=self.controllers)
        self.plant, self.step = begun.fleet.uavs[0], 0
        self.runway = self.controllers.uavs[0]["guidance"]["runway"]
        self._room = in_process.room_of(self.scenario, _LOOK_STEPS).part(0, _LOOK_STEPS)[1:]
        self.loss: str | None = None
        self.told: list[str] = []
        observe(begun.fleet, 0, 0, self.scenario.step_us)
        self._hear()
        self.upload_items(list(self.scenario.mission_items()))
        self.command(ARM, 1.0)
        self.command(START)
        self.run()

    @property
    def height(self) -> float:
        """Height of the centre of gravity [m]."""
        return -float(self.plant["state"][2])

    @property
    def outcome(self) -> str:
        """What became of it on the ground."""
        facts = contact_facts(self.plant["gear"])
        assert facts is not None
        return str(facts["outcome"])

    def fly_to(self, phase: int, also: Callable[[], bool] = lambda: True) -> None:
        """Fly up to a phase of take-off or landing, in which something else holds as well."""
        self.fly_on(300.0, lambda: self.runway["phase"] == phase and also())
        assert self.runway["phase"] == phase, (self.runway["phase"], self.loss)

    def fly_on(self, seconds: float, ends: Callable[[], bool] = lambda: False) -> None:
        """Fly for a time, at most until something holds or the aircraft is lost."""
        flight, step_us = self.flight, self.scenario.step_us
        end = self.step + seconds * 1e6 / step_us
        while self.step < end and self.loss is None and not ends():
            parts = (flight.fleet, flight.estimates, self.controllers, flight.sources)
            flown, lost = in_process.run_steps(*parts, self.step, step_us, *self._room)
            self.step += flown
            self._hear()
            self.vehicle.handle_timer(self.now)
            texts = of_type(self.vehicle.gcs_messages(), "STATUSTEXT")
            self.told += [message.text for message in texts]
            if lost >= 0:
                self.loss = loss_of(flight.fleet, lost)

    def _hear(self) -> None:
        message = self.plant["message"]
        for name in message.dtype.names:
            self.hot.measured[name] = message[name]
        self.hot.step, self.hot.step_us = self.step, self.scenario.step_us
        self.now = self.step * self.scenario.step_us / 1e6
