"""What the diagnosis of the own actuators reports to ground stations: a message, texts, health."""

import math
from collections.abc import Iterator

from ftc_autopilot.control.controllers import Controllers
from ftc_autopilot.control.diagnosis import LOST
from ftc_autopilot.control.laws import heading_loop, own_state
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.changes import Change
from ftc_autopilot.vehicle.message import message
from mavlink_defs import dialect
from mavlink_defs.constants import ACTUATORS, RUDDER, THROTTLE
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.float32 import float32s
from sitl_plant.airframe.stops import has_actuator

_NOTHING = "nothing replaces it"
_TAKEN_OVER = {
    "aileron": "roll by rudder, heading given up",
    "elevator": "pitch by thrust if need be, airspeed given up",
    "rudder": "roll by aileron, heading given up",
    "throttle": _NOTHING,
}


class DiagnosisMessages:
    """Makes messages and texts from the diagnosis of the last step."""

    def __init__(self, hot: HotState, controllers: Controllers, law: LawParameters) -> None:
        self._hot, self._controllers = hot, controllers
        state = own_state(controllers.uavs[0]["controller"], type(law), law.kind)
        if law.FALLBACK is not None:
            state = state["fallback"]
        self._diagnosis = state["diagnosis"] if "diagnosis" in (state.dtype.names or ()) else None
        self._lost = [False] * len(ACTUATORS)
        self._has_rudder = has_actuator(controllers.uavs[0]["aircraft"], RUDDER)

    @message(dialect.MAVLink_ftc_diagnosis_message)
    def diagnosis(self) -> MAVLink_message:
        """Return FTC_DIAGNOSIS; without a diagnosis, everything is unknown."""
        n = len(ACTUATORS)
        if self._diagnosis is None:
            unknown = [math.nan] * n
            return dialect.MAVLink_ftc_diagnosis_message(
                self._hot.time_ms, unknown, unknown, unknown, [dialect.FTC_PHASE_UNKNOWN] * n
            )
        signals = self._controllers.uavs[0]["signals"]
        offsets = [self._amount(c, float(signals["offset"][c])) for c in range(n)]
        return dialect.MAVLink_ftc_diagnosis_message(
            self._hot.time_ms,
            float32s(signals["effectiveness"]),
            float32s(offsets),
            float32s(signals["confidence"]),
            [int(phase) for phase in signals["phase"]],
        )

    def healthy(self) -> bool:
        """Return whether no actuator is lost, as far as is known."""
        return not (self._controllers.uavs[0]["signals"]["phase"] == LOST).any()

    def changes(self) -> Iterator[Change]:
        """Yield each decision since the last call."""
        if self._diagnosis is None:
            return
        before, self._lost = self._lost, (self._diagnosis["actuators"]["lost"] != 0).tolist()
        for c, (name, lost) in enumerate(zip(ACTUATORS, self._lost, strict=True)):
            if lost == before[c]:
                continue
            actuator = self._diagnosis["actuators"][c]
            if actuator["decided_s"] >= self._diagnosis["age"]:  # no decision: the law restarted
                continue
            at = f"at {self._hot.time_s - float(actuator['decided_s']):.2f} s"
            if lost:
                stuck = self._amount(c, float(actuator["stuck"]))
                where = f"{stuck:.0f} N" if c == THROTTLE else f"{stuck:.1f} deg"
                text = f"{name} lost {at}, held at {where}, {self._taken_over(name)}"
                yield Change(name, dialect.MAV_SEVERITY_CRITICAL, text)
            else:
                yield Change(name, dialect.MAV_SEVERITY_NOTICE, f"{name} back in service {at}")

    def _taken_over(self, name: str) -> str:
        """Return what takes over from a lost actuator, and what is given up."""
        if name == "aileron" and not self._has_rudder:
            return _NOTHING
        text = _TAKEN_OVER[name]
        by_bank = heading_loop(self._controllers.uavs[0]["parameters"]).by_bank
        return text.replace("heading given up", "heading by bank") if by_bank else text

    @staticmethod
    def _amount(channel: int, value: float) -> float:
        """Return an angle in degrees, a thrust unchanged [N]."""
        return value if channel == THROTTLE else math.degrees(value)
