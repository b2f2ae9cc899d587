"""The failsafes of a flight in one process: the vehicles' own, which look at the same steps."""

import numpy as np

from ftc_autopilot.control.controllers import Controllers
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.hot.state import new_autopilots
from ftc_autopilot.vehicle.failsafe import ActuatorFailsafe
from ftc_autopilot.vehicle.flight_path import FlightPath, VehicleHome
from ftc_autopilot.vehicle.modes import Modes
from gcs.scenario.model import Scenario
from mavlink_defs import dialect
from mavlink_defs.constants import AUTO

_NEVER = 2**62


class Failsafes:
    """What the vehicles of a flight on a mission do by themselves when an actuator is lost."""

    def __init__(self, scenario: Scenario, controllers: Controllers) -> None:
        """Watch the controllers, in the order of the scenario's UAVs."""
        self._watching: list[tuple[int, HotState, ActuatorFailsafe]] = []
        if scenario.failsafe.act_fail_act == "report" or scenario.mission is None:
            return
        for i, uav in enumerate(scenario.uavs):
            config = scenario.autopilot_config(uav.id)
            hot = HotState(new_autopilots([config], binds=False))
            hot.step_us, hot.flags = scenario.step_us, dialect.FTC_SIM_FLAGS_RUNNING
            own = Controllers(*(part[i : i + 1] for part in controllers))
            path = FlightPath(config, hot, own, VehicleHome(config.origin))
            path.items = tuple(scenario.mission_items())
            modes = Modes(config, hot, own, path, lambda *_: None)
            modes.resume(AUTO)
            self._watching.append((i, hot, ActuatorFailsafe(hot, own, modes)))

    @property
    def next_step(self) -> int:
        """Step after which they are to look next; far away if there is none."""
        return min((one.next_step for _, _, one in self._watching), default=_NEVER)

    def look(self, step: int, measured: np.ndarray) -> None:
        """Let them act after a step, by the states (n,) in it, dtype SIM_STATE."""
        for i, hot, failsafe in self._watching:
            for name in measured.dtype.names or ():
                hot.measured[name] = measured[i][name]
            hot.step = step
            failsafe.handle_timer()
