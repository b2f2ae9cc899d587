"""Private messages: tracking, events, adaptation, and datagrams dropped on the links."""

import math
from collections.abc import Iterator

import numpy as np

from ftc_autopilot.common.angles import wrap
from ftc_autopilot.control.controller import NO_INTERVAL
from ftc_autopilot.control.controllers import Controllers
from ftc_autopilot.control.laws import own_state
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.changes import Change
from ftc_autopilot.vehicle.message import message
from mavlink_defs import dialect
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.float32 import float32s
from mavlink_defs.framing.codec import drop_counts


class ControllerMessages:
    """Makes messages from the controller's last step."""

    def __init__(self, hot: HotState, controllers: Controllers, law: LawParameters) -> None:
        self._hot, self._controllers, self._law = hot, controllers, law
        self._failed = [False] * len(ACTUATORS)

    def changes(self) -> Iterator[Change]:
        """Yield that the law gave no finite command, once for each channel."""
        before, self._failed = (
            self._failed,
            (self._controllers.uavs[0]["controller"]["not_finite"] > 0).tolist(),
        )
        new = [
            name
            for name, now, was in zip(ACTUATORS, self._failed, before, strict=True)
            if now > was
        ]
        if new:
            at = f"at {self._hot.time_s:.2f} s"
            text = f"law failed {at}: no finite command of {' and '.join(new)}, last one held"
            yield Change("law", dialect.MAV_SEVERITY_CRITICAL, text)

    @message(dialect.MAVLink_ftc_tracking_message)
    def tracking(self) -> MAVLink_message:
        """Return FTC_TRACKING."""
        signals = self._controllers.uavs[0]["signals"]
        return dialect.MAVLink_ftc_tracking_message(
            self._hot.time_ms,
            _degrees(signals["reference"]),
            _degrees(signals["error"]),
            _degrees(signals["sync_error"]),
        )

    @message(dialect.MAVLink_ftc_events_message)
    def events(self) -> MAVLink_message:
        """Return FTC_EVENTS."""
        controller = self._controllers.uavs[0]["controller"]
        intervals = [
            min(int(steps) * self._hot.step_us, NO_INTERVAL) for steps in controller["min_interval"]
        ]
        return dialect.MAVLink_ftc_events_message(
            time_boot_ms=self._hot.time_ms,
            steps=int(controller["steps"]),
            events=list(map(int, controller["events"])),
            min_interval_us=intervals,
            messages=int(controller["messages"]),
            repeats=self._hot.repeated,
            edge_changes=self._hot.edge_changes,
            predicted_exit=float32s(self._controllers.uavs[0]["signals"]["predicted_exit"]),
            neighbour_messages=int(controller["neighbour_messages"]) * len(self._hot.neighbours),
            oldest_state_us=min(self._hot.oldest_state_us, NO_INTERVAL),
        )

    @message(dialect.MAVLink_ftc_adaptation_message)
    def adaptation(self) -> MAVLink_message:
        """Return FTC_ADAPTATION; NaN under a law without these estimates."""
        state = own_state(self._controllers.uavs[0]["controller"], type(self._law), self._law.kind)
        known = state.dtype.names or ()
        names = ("Phi_v", "g_v", "beta_v", "Phi_omega", "beta_omega")
        estimates = (state[name] if name in known else math.nan for name in names)
        return dialect.MAVLink_ftc_adaptation_message(self._hot.time_ms, *float32s(estimates))

    @message(dialect.MAVLink_ftc_drops_message)
    def drops(self) -> MAVLink_message:
        """Return FTC_DROPS."""
        links = map(drop_counts, self._hot.drops)  # in the order of the fields
        return dialect.MAVLink_ftc_drops_message(self._hot.time_ms, *links)


def _degrees(values: np.ndarray) -> list[float]:
    """Return airspeed unchanged, angles in deg within ±180°."""
    angles = (float(angle) for angle in values[1:4])
    degrees = (math.degrees(wrap(a)) if math.isfinite(a) else math.nan for a in angles)
    return float32s((float(values[0]), *degrees))
