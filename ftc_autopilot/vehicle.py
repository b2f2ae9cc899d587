"""One UAV as a MAVLink vehicle: modes, arming, missions, commands, telemetry.

No socket and no clock: messages and the time go in, messages to send come out. What it decides
reaches the controller through the crew's guidance and profile, between two steps.
"""

import math
from collections import deque

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.link import AutopilotLink
from ftc_autopilot.onboard import NOT_STARTED, Crew
from ftc_autopilot.reference import profile_record
from ftc_autopilot.telemetry import Telemetry
from mavlink_defs import dialect
from mavlink_defs.command import (
    CommandClient,
    CommandFinished,
    CommandMessage,
    CommandReceived,
    CommandServer,
    command_params,
)
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.frames import text_chunks
from mavlink_defs.machine import Address
from mavlink_defs.mission_server import (
    CurrentChanged,
    MissionAccepted,
    MissionRefused,
    MissionServer,
)
from mavlink_defs.profile import AirspeedLimits, check_mission, items_to_segments
from sitl_plant.link import SIMULATOR_COMPONENT

__all__ = ["AUTO", "GUIDED", "LOITER", "MODE_NAMES", "Vehicle"]

AUTO, LOITER, GUIDED = 10, 12, 15
"""custom_mode numbers of ArduPlane."""
MODE_NAMES = {AUTO: "AUTO", LOITER: "LOITER", GUIDED: "GUIDED"}

_HEARTBEAT_S = 1.0
_FORCE_DISARM = 21196.0
_FOR_THE_SIMULATOR = {
    dialect.MAV_CMD_FTC_SET_FAULT,
    dialect.MAV_CMD_FTC_CLEAR_FAULTS,
    dialect.MAV_CMD_INJECT_FAILURE,
}
_ACCEPTED, _DENIED = dialect.MAV_RESULT_ACCEPTED, dialect.MAV_RESULT_DENIED


class Vehicle:
    """The services of one autopilot, between the steps of its control loop."""

    def __init__(self, config: AutopilotConfig, link: AutopilotLink, crew: Crew) -> None:
        self.mode = LOITER
        self.armed = False
        self._link = link
        self._guidance = crew.guidance[0]
        self._crew = crew
        self._airspeeds = AirspeedLimits(
            config.aircraft.airspeed_min_m_s, config.aircraft.airspeed_max_m_s
        )
        own = Address(config.id, dialect.MAV_COMP_ID_AUTOPILOT1)
        self._own = own
        self.telemetry = Telemetry(link, crew)
        self._commands = CommandServer(own)
        self._mission = MissionServer(own, lambda items: check_mission(items, self._airspeeds))
        self._to_simulator: deque[CommandReceived] = deque()
        self._simulator = CommandClient(own)
        self._gcs_outbox: list[MAVLink_message] = []
        self._simulator_outbox: list[MAVLink_message] = []
        self._next_heartbeat = -math.inf
        self._told = (-1, False, -1)
        self._texts = 0
        self._edges = crew.weights[0] > 0.0
        self._edge_changes = 0

    # messages in

    def receive(self, message: MAVLink_message, now: float) -> None:
        """Take in a message of a ground station; those of no concern are ignored."""
        if isinstance(message, dialect.MAVLink_set_attitude_target_message):
            self._set_attitude_target(message)
        self._commands.receive(message, now)
        self._mission.receive(message, now)
        self._work(now)

    def receive_from_simulator(self, message: MAVLink_message, now: float) -> None:
        """Take in a message of the own aircraft's simulator component."""
        self._simulator.receive(message, now)
        match message:
            case dialect.MAVLink_statustext_message():
                self._gcs_outbox.append(message)
            case dialect.MAVLink_ftc_fault_message():
                self._gcs_outbox.append(message)
        self._work(now)

    def tick(self, now: float) -> None:
        """Do what is due: timers, heartbeats, mission progress, telemetry. Call it often.

        Args:
            now: Wall-clock time [s].
        """
        for machine in (self._commands, self._mission, self._simulator):
            machine.handle_timer(now)
        news = (self._status, self.armed, self.mode)
        if now >= self._next_heartbeat or news != self._told:
            self._next_heartbeat, self._told = now + _HEARTBEAT_S, news
            self._gcs_outbox.append(self._heartbeat())
            self._simulator_outbox.append(self._heartbeat())
        self._follow_mission()
        self._report_edges()
        if self._link.clock[0]["heard_s"] > 0.0:
            time_us = int(self._link.measured[0]["time_usec"])
            clock_us = time_us if self.running else round(now * 1e6)
            self._gcs_outbox += self.telemetry.due(clock_us)
        self._work(now)

    def farewell(self, text: str) -> None:
        """Say last words, and the final counters, before the process ends."""
        self.say(dialect.MAV_SEVERITY_NOTICE, text)
        self._gcs_outbox.append(self.telemetry.make(dialect.MAVLINK_MSG_ID_FTC_EVENTS))

    def say(self, severity: int, text: str) -> None:
        """Queue a STATUSTEXT."""
        self._texts += 1
        self._gcs_outbox += text_chunks(severity, text, self._texts)

    # messages out

    def gcs_messages(self) -> list[MAVLink_message]:
        """Hand over what is to be sent to the ground stations."""
        messages, self._gcs_outbox = self._gcs_outbox, []
        return messages

    def simulator_messages(self) -> list[MAVLink_message]:
        """Hand over what is to be sent to the simulator component."""
        messages, self._simulator_outbox = self._simulator_outbox, []
        return messages

    # state

    @property
    def running(self) -> bool:
        """Whether simulated time runs."""
        return bool(self._link.clock[0]["flags"] & dialect.FTC_SIM_FLAGS_RUNNING)

    @property
    def time_s(self) -> float:
        """Simulation time of the last state [s]."""
        return float(self._link.measured[0]["time_usec"]) * 1e-6

    @property
    def _status(self) -> int:
        """MAV_STATE: BOOT until the simulator is heard."""
        if self._link.clock[0]["heard_s"] == 0.0:
            return dialect.MAV_STATE_BOOT
        return dialect.MAV_STATE_ACTIVE if self.armed else dialect.MAV_STATE_STANDBY

    # inside

    def _work(self, now: float) -> None:
        for event in self._mission.events():
            match event:
                case MissionAccepted(items):
                    self._accept_mission(items)
                case CurrentChanged(seq):
                    self._jump_to(seq)
                case MissionRefused(_, text) if text:
                    self.say(dialect.MAV_SEVERITY_WARNING, text)
        for command in self._commands.events():
            self._execute(command, now)
        for done in self._simulator.events():
            if isinstance(done, CommandFinished):
                token = self._to_simulator.popleft().token
                result = dialect.MAV_RESULT_FAILED if done.result is None else done.result
                self._commands.finish(token, result, now=now)
        if self._to_simulator and not self._simulator.busy:
            self._simulator.send(_readdressed(self._to_simulator[0].message, self._own), now)
        self._gcs_outbox += self._commands.messages_to_send() + self._mission.messages_to_send()
        self._simulator_outbox += self._simulator.messages_to_send()

    def _heartbeat(self) -> MAVLink_message:
        flags = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | dialect.MAV_MODE_FLAG_STABILIZE_ENABLED
        flags |= dialect.MAV_MODE_FLAG_GUIDED_ENABLED if self.mode != LOITER else 0
        flags |= dialect.MAV_MODE_FLAG_AUTO_ENABLED if self.mode == AUTO else 0
        flags |= dialect.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        return dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_FIXED_WING,
            dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
            flags,
            self.mode,
            self._status,
            3,
        )

    def _accept_mission(self, items: tuple[dialect.MAVLink_mission_item_int_message, ...]) -> None:
        if len(items) < 2:  # home alone: no profile
            self._crew.profiles[0]["count"] = 0
            self._guidance["start_step"] = NOT_STARTED
            if self.mode == AUTO:
                self._enter(LOITER)
            return
        segments = items_to_segments(items, self._airspeeds)
        self._crew.profiles[0] = profile_record(segments)
        self.say(dialect.MAV_SEVERITY_INFO, f"profile of {len(segments)} segments in force")

    def _execute(self, command: CommandReceived, now: float) -> None:
        message, params = command.message, command_params(command.message)
        number = message.command
        is_fault_list = (
            number == dialect.MAV_CMD_REQUEST_MESSAGE
            and params[0] == dialect.MAVLINK_MSG_ID_FTC_FAULT
        )
        if number in _FOR_THE_SIMULATOR or is_fault_list:
            self._to_simulator.append(command)
            return
        handlers = {
            dialect.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_or_disarm,
            dialect.MAV_CMD_MISSION_START: self._start_mission,
            dialect.MAV_CMD_DO_SET_MODE: self._set_mode,
            dialect.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            dialect.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            dialect.MAV_CMD_REQUEST_MESSAGE: self._send_requested,
        }
        handler = handlers.get(number)
        result = handler(params) if handler else dialect.MAV_RESULT_UNSUPPORTED
        self._commands.finish(command.token, result, now=now)

    def _refuse(self, text: str) -> int:
        self.say(dialect.MAV_SEVERITY_WARNING, text)
        return _DENIED

    def _arm_or_disarm(self, params: tuple[float, ...]) -> int:
        if params[0] not in {0.0, 1.0}:
            return self._refuse(f"Arm: param 1 is {params[0]:g}, must be 0 or 1")
        if params[0] == 1.0:
            if self._status == dialect.MAV_STATE_BOOT:
                self._refuse("Arm: no state from the simulator yet")
                return dialect.MAV_RESULT_TEMPORARILY_REJECTED
            if not self.armed:
                self.armed = True
                self._crew.actuators[0]["mode"] = dialect.MAV_MODE_FLAG_SAFETY_ARMED
                self._guidance["active"] = 1
                self._enter(self.mode)
        elif self.armed:
            if self.running and params[1] != _FORCE_DISARM:
                return self._refuse("Disarm: refused in flight; force it with param 2 = 21196")
            self.armed = False
            self._crew.actuators[0]["mode"] = 0
            self._guidance["active"] = 0
        return _ACCEPTED

    def _start_mission(self, _: tuple[float, ...]) -> int:
        if self._crew.profiles[0]["count"] == 0:
            return self._refuse("Mission start: no profile uploaded")
        if self.running and not self.armed:
            return self._refuse("Mission start: not armed")
        clock = self._link.clock[0]
        self._guidance["start_step"] = clock["step"] + 1 if self.running else 0
        self._enter(AUTO)
        return _ACCEPTED

    def _set_mode(self, params: tuple[float, ...]) -> int:
        mode = params[1]
        if mode not in MODE_NAMES:
            return self._refuse(f"Mode {mode:g}: must be AUTO (10), LOITER (12), GUIDED (15)")
        if mode == AUTO and self._crew.profiles[0]["count"] == 0:
            return self._refuse("Mode AUTO: no profile uploaded")
        self._enter(int(mode))
        return _ACCEPTED

    def _enter(self, mode: int) -> None:
        """Change the mode; whatever does not fly the profile goes on level and straight."""
        started = self._guidance["start_step"] != NOT_STARTED
        self._guidance["auto"] = int(mode == AUTO and started)
        if not self._guidance["auto"]:
            state = self._link.measured[0]
            speed = math.hypot(*map(float, state["velocity"]))
            airspeed = min(max(speed, self._airspeeds.min_m_s), self._airspeeds.max_m_s)
            self._guidance["command"] = (airspeed, 0.0, 0.0, float(state["attitude"][2]))
        if mode != self.mode:
            self.mode = mode
            self.say(dialect.MAV_SEVERITY_INFO, f"mode {MODE_NAMES[mode]}")

    def _change_speed(self, params: tuple[float, ...]) -> int:
        if self._guidance["auto"]:
            return self._refuse("Change speed: not while a profile is flown")
        low, high = self._airspeeds.min_m_s, self._airspeeds.max_m_s
        if not low <= params[1] <= high:
            return self._refuse(f"Speed is {params[1]:g} m/s, must be {low:g} to {high:g} m/s")
        self._guidance["command"][0] = params[1]
        return _ACCEPTED

    def _set_attitude_target(self, message: dialect.MAVLink_set_attitude_target_message) -> None:
        """Follow an attitude set-point in GUIDED; its quaternion is body to NED, scalar first."""
        if self.mode != GUIDED or message.target_system not in {0, self._own.system}:
            return
        w, x, y, z = map(float, message.q)
        length = math.sqrt(w * w + x * x + y * y + z * z)
        if not 0.9 < length < 1.1 or message.type_mask & (
            dialect.ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE
        ):
            return
        w, x, y, z = w / length, x / length, y / length, z / length
        self._guidance["command"][1:] = (
            math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0)),
            math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        )

    def _set_interval(self, params: tuple[float, ...]) -> int:
        message_id, interval_us = _whole(params[0]), params[1]
        if not self.telemetry.knows(message_id) or not math.isfinite(interval_us):
            return _DENIED
        self.telemetry.set_interval(message_id, interval_us)
        return _ACCEPTED

    def _send_requested(self, params: tuple[float, ...]) -> int:
        message_id = _whole(params[0])
        if message_id == dialect.MAVLINK_MSG_ID_HEARTBEAT:
            self._gcs_outbox.append(self._heartbeat())
        elif message_id == dialect.MAVLINK_MSG_ID_MISSION_CURRENT:
            self._gcs_outbox.append(self._mission.mission_current())
        elif self.telemetry.knows(message_id):
            self._gcs_outbox.append(self.telemetry.make(message_id))
        else:
            return dialect.MAV_RESULT_UNSUPPORTED
        return _ACCEPTED

    def _jump_to(self, seq: int) -> None:
        """Let a running mission go on with item seq, as if its segment began now."""
        if self._guidance["start_step"] != NOT_STARTED and 1 <= seq != self._item_in_force():
            start_s = float(self._crew.profiles[0]["start"][seq - 1])
            clock = self._link.clock[0]
            steps = math.ceil(start_s * 1e6 / int(clock["step_us"]))
            self._guidance["start_step"] = int(clock["step"]) - steps

    def _item_in_force(self) -> int:
        """Number of the mission item whose segment the mission's clock stands in."""
        clock, profile = self._link.clock[0], self._crew.profiles[0]
        steps = int(clock["step"]) - int(self._guidance["start_step"])
        elapsed_s = steps * int(clock["step_us"]) / 1e6
        return 1 + sum(
            elapsed_s > float(start) for start in profile["start"][1 : int(profile["count"])]
        )

    def _follow_mission(self) -> None:
        """Let MISSION_CURRENT and MISSION_ITEM_REACHED follow the profile."""
        if not self._guidance["auto"] or not self.running:
            return
        current = self._item_in_force()
        if current != self._mission.current:
            for seq in range(max(self._mission.current, 1), current):
                self._gcs_outbox.append(dialect.MAVLink_mission_item_reached_message(seq))
            self._mission.set_current(current)

    def _report_edges(self) -> None:
        """Announce every neighbour that was dropped or taken up again."""
        if self._link.clock[0]["edge_changes"] == self._edge_changes:
            return
        self._edge_changes = int(self._link.clock[0]["edge_changes"])
        edges = self._crew.weights[0] > 0.0
        for d in (edges != self._edges).nonzero()[0]:
            event = "heard again, edge taken up" if edges[d] else "silent, edge dropped"
            text = f"neighbour {self._link.neighbours[d]} {event}"
            self.say(dialect.MAV_SEVERITY_WARNING, text)
        self._edges = edges


def _whole(value: float) -> int:
    """A parameter that should be a whole number; -1 if it is no number at all."""
    return int(value) if math.isfinite(value) else -1


def _readdressed(message: CommandMessage, own: Address) -> CommandMessage:
    """The same command for the own simulator component."""
    target = (own.system, SIMULATOR_COMPONENT)
    p1, p2, p3, p4, p5, p6, p7 = command_params(message)
    if isinstance(message, dialect.MAVLink_command_int_message):
        return dialect.MAVLink_command_int_message(
            *target, message.frame, message.command, 0, 0, p1, p2, p3, p4, message.x, message.y, p7
        )
    return dialect.MAVLink_command_long_message(
        *target, message.command, 0, p1, p2, p3, p4, p5, p6, p7
    )
