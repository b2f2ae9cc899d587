"""One UAV as a MAVLink vehicle: its services, answers and reports.

No socket and no clock: messages and the time go in, messages to send come out. The services
are modules of their own; here they are put together.
"""

import math
from collections.abc import Iterable
from itertools import chain

import numpy as np

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.controllers import Controllers, reset_controllers
from ftc_autopilot.control.reference import profile_segments
from ftc_autopilot.guidance.fence_parameters import fence_records
from ftc_autopilot.hot.drops import GCS, PLANT
from ftc_autopilot.hot.hot_state import HotState
from ftc_autopilot.vehicle.changes import Changes
from ftc_autopilot.vehicle.clock import VehicleClock
from ftc_autopilot.vehicle.commands import Commands, Handler, PlaceHandler
from ftc_autopilot.vehicle.controller_messages import ControllerMessages
from ftc_autopilot.vehicle.diagnosis_messages import DiagnosisMessages
from ftc_autopilot.vehicle.estimator_messages import EstimatorMessages
from ftc_autopilot.vehicle.failsafe import ActuatorFailsafe
from ftc_autopilot.vehicle.flight_path import FlightPath, VehicleHome
from ftc_autopilot.vehicle.formation_messages import FormationMessages
from ftc_autopilot.vehicle.guided import Guided
from ftc_autopilot.vehicle.message_requests import MessageRequests
from ftc_autopilot.vehicle.mission_checkpoint import MissionCheckpoint
from ftc_autopilot.vehicle.modes import Modes
from ftc_autopilot.vehicle.neighbour_edges import NeighbourEdges
from ftc_autopilot.vehicle.old_states import OldStates
from ftc_autopilot.vehicle.param_table import parameters_of
from ftc_autopilot.vehicle.path_messages import PathMessages
from ftc_autopilot.vehicle.plan import VehiclePlan
from ftc_autopilot.vehicle.resumption import Resumption
from ftc_autopilot.vehicle.runway import RunwayMessages
from ftc_autopilot.vehicle.sensor_messages import SensorMessages, TrueStateSensors
from ftc_autopilot.vehicle.shown_state import ShownState
from ftc_autopilot.vehicle.state_messages import StateMessages
from ftc_autopilot.vehicle.status_messages import StatusMessages
from ftc_autopilot.vehicle.telemetry import Telemetry
from ftc_autopilot.vehicle.telemetry_clock import TelemetryClock
from mavlink_defs import dialect
from mavlink_defs.config import renamed
from mavlink_defs.constants import LOITER, RTL
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.framing.drop_reason import DropReason
from mavlink_defs.framing.frames import text_chunks
from mavlink_defs.profile import segments_to_items
from mavlink_defs.services.command import CommandMessage
from mavlink_defs.services.machine import SystemId, is_for
from mavlink_defs.services.param_server import ParamChanged, ParamRefused, ParamRenamed, ParamServer
from mavlink_defs.services.responder import Responder
from mavlink_defs.system_ids import bits_of

_HEARTBEAT_S = 1.0
_REGISTER_S = 0.1  # between HEARTBEATs to the plant until it answers


class VehicleServices:
    """The services of one autopilot, between the steps of its control loop."""

    def __init__(
        self, config: AutopilotConfig, hot: HotState, controllers: Controllers, unix_s: float = 0.0
    ) -> None:
        """Boot.

        Args:
            config: The configuration.
            hot: What the compiled loop knows.
            controllers: Of one UAV.
            unix_s: The date, Unix time [s]; 0 if it does not matter.
        """
        own = SystemId(config.id, dialect.MAV_COMP_ID_AUTOPILOT1)
        self._own, self._hot, self._controllers = own, hot, controllers
        self._stations = range(len(config.gcs))
        self._gcs_outboxes: list[list[MAVLink_message]] = [[] for _ in self._stations]
        self._simulator_outbox: list[MAVLink_message] = []
        self._next_heartbeat = self._next_registration = -math.inf
        self._reported = (-1, False, -1)
        self._texts = 0

        self._home = VehicleHome(config.origin)
        path = FlightPath(config, hot, controllers, self._home)
        self.modes = Modes(config, hot, controllers, path, self.say)
        self._guided = Guided(config.origin, self.modes, self.say)
        self._clock = VehicleClock(round(unix_s * 1e6))
        fence = fence_records(config.fence, config.rally)
        guide = self._guided.fly_to_item
        self._plan = VehiclePlan(config, hot, self.modes, guide, fence, self._clock, self.say)
        self._controller = ControllerMessages(hot, controllers, config.controller)
        self._diagnosis = DiagnosisMessages(hot, controllers, config.controller)
        self._formation = FormationMessages(config, hot, controllers, self.say)
        self._resumption = Resumption(hot)
        self._edges = NeighbourEdges(hot)
        self._old_states = OldStates(hot)
        self._changes = Changes()
        shown = ShownState(hot, config.origin, self._home)
        self._estimator = EstimatorMessages(hot, shown, self._clock)
        self._runway = RunwayMessages(shown, self.modes, self.say)
        self._failsafe = ActuatorFailsafe(hot, controllers, self.modes)
        makers = (
            StateMessages(shown, controllers, self._home, self._clock),
            TrueStateSensors(shown, self._clock)
            if shown.report is None
            else SensorMessages(hot, shown, self._clock),
            self._controller,
            self._diagnosis,
            self._estimator,
            self._formation,
            StatusMessages(
                config,
                self._diagnosis.healthy,
                self._estimator,
                self._plan.fence,
                lambda: int(hot.drops[GCS].sum()),
                self._clock,
            ),
            PathMessages(shown, controllers, path, self._clock),
            self._plan.mission,
            self._plan.fence,
            self._runway,
        )
        self.telemetry = [Telemetry(*makers) for _ in self._stations]
        self.telemetry_clock = TelemetryClock(config.telemetry_clock, hot)
        self._params = ParamServer(
            own,
            parameters_of(config, hot, controllers, fence),
            bytewise=config.identity == "generic",
            renamed=renamed.PARAMETERS,
        )
        fleet = bits_of(config.fleet)
        self._requests = MessageRequests(
            self.telemetry,
            {
                dialect.MAVLINK_MSG_ID_HEARTBEAT: self.modes.heartbeat,
                dialect.MAVLINK_MSG_ID_FTC_FLEET: lambda: dialect.MAVLink_ftc_fleet_message(fleet),
            },
            self._queue,
            self.say,
        )
        self._commands = Commands(own, self._handlers(), self._place_handlers())
        self._responder = Responder(own)

    # messages in

    def receive(self, message: MAVLink_message, now: float, station: int = 0) -> None:
        """Take in a message of a ground station; one of no concern is ignored.

        Args:
            message: The message.
            now: Wall-clock time [s].
            station: Number of the station in `AutopilotConfig.gcs`.
        """
        if not is_for(message, self._own):
            self._hot.drops[GCS, -DropReason.OTHER_TARGET] += 1
            return
        self._advance_clock(now)
        match message:
            case dialect.MAVLink_set_attitude_target_message():
                self._guided.set_attitude_target(message)
            case dialect.MAVLink_set_position_target_global_int_message():
                self._guided.set_position_target(message)
            case dialect.MAVLink_set_mode_message():  # superseded message, which has no answer
                self.modes.set_mode(float(message.custom_mode))
        self._requests.station = station
        self.telemetry[station].receive(message)
        self._commands.receive(message, now, station)
        self._plan.receive(message, now, station)
        self._params.receive(message, now)
        self._responder.receive(message, self._clock.boot_us * 1e-6)
        self._queue(self._responder.messages_to_send(), station)
        self._collect()

    def receive_from_simulator(self, message: MAVLink_message, now: float) -> None:
        """Take in a message of the own aircraft's simulator component."""
        match message:
            case dialect.MAVLink_statustext_message():
                self._queue([message])
            case dialect.MAVLink_ftc_fault_message():
                self._queue([message], self._commands.asking)
            case dialect.MAVLink_ftc_drops_message():
                for reason, count in zip(DropReason, message.plant, strict=True):
                    self._hot.drops[PLANT, -reason] = count
        self._commands.receive_from_simulator(message, now)
        self._collect()

    def handle_timer(self, now: float, most: int | None = None) -> None:
        """Do what is due: timers, heartbeats, mission progress, telemetry.

        Call it at `deadline`, and when the telemetry's clock reaches `next_telemetry_us`.

        Args:
            now: Wall-clock time [s].
            most: How many messages of telemetry to make, at most; None: all that are due.
        """
        self._advance_clock(now)
        self._commands.handle_timer(now)
        self._params.handle_timer(now)
        self.modes.handle_timer()
        self._plan.handle_timer(now)
        self._failsafe.handle_timer()
        state = (self.modes.status, self.modes.armed, self.modes.mode)
        if now >= self._next_heartbeat or state != self._reported:
            self._next_heartbeat, self._reported = now + _HEARTBEAT_S, state
            self._queue([self.modes.heartbeat()])
            self._simulator_outbox.append(self.modes.heartbeat())
            self._next_registration = now + _REGISTER_S
        if now >= self._next_registration and self.modes.status == dialect.MAV_STATE_BOOT:
            self._next_registration = now + _REGISTER_S
            self._simulator_outbox.append(self.modes.heartbeat())
        self._report_changes()
        if self._hot.heard_s > 0.0:
            clock_us = self.telemetry_clock.read_us(now)
            for station, telemetry in enumerate(self.telemetry):
                self._gcs_outboxes[station][:0] = telemetry.due(clock_us, most)
        self._collect()

    def deadline(self) -> float:
        """Return the wall-clock time of the next timer or heartbeat [s]."""
        timers = (self._commands.deadline(), self._params.deadline(), self._plan.deadline())
        return min([self._next_heartbeat, *(at for at in timers if at is not None)])

    def restart(self) -> None:
        """Forget the flight when the plant was started again: disarm and wait to be armed."""
        self._hot.reset()
        reset_controllers(self._controllers)
        self.modes.restart()
        self._plan.restart()
        self._failsafe.restart()
        self._resumption = Resumption(self._hot)
        self._edges = NeighbourEdges(self._hot)
        self._old_states = OldStates(self._hot)
        self._changes = Changes()
        self.say(dialect.MAV_SEVERITY_WARNING, "plant restarted: disarmed, arm to fly again")
        self._collect()

    def resume(self, saved: np.void, plan: MissionCheckpoint | None = None) -> None:
        """Go on from a checkpoint; the records are restored already.

        Args:
            saved: Record of dtype `ftc_autopilot.hot.checkpoint.VEHICLE`.
            plan: Its plan; None: a profile that the records hold, if there is any.
        """
        segments = profile_segments(self._controllers.uavs[0]["profile"])
        items = segments_to_items(segments, *self._own) if segments else []
        self._plan.resume(plan, items, int(saved["item"]))
        self.modes.resume(int(saved["mode"]))
        self._failsafe.restart(int(saved["acted"]))
        self._resumption.resume()

    def save(self, to: np.void) -> None:
        """Write what a checkpoint has of the vehicle, record of dtype `hot.checkpoint.VEHICLE`."""
        to["mode"], to["item"] = self.modes.mode, self._plan.mission.server.current
        to["acted"] = self._failsafe.acted

    def mission_checkpoint(self) -> tuple[int, MissionCheckpoint]:
        """Return the plan, and a number that changes with it."""
        return self._plan.checkpoint()

    def end_control(self, why: str) -> None:
        """Disarm at once, as no law flies this aircraft any more."""
        self.modes.set_armed(False)
        self.say(dialect.MAV_SEVERITY_CRITICAL, f"{why}; disarmed")

    def farewell(self, text: str, severity: int = dialect.MAV_SEVERITY_NOTICE) -> None:
        """Send what is not yet reported, a last text and the final counters: the process ends."""
        self._report_changes()
        for held in self._changes.left():
            self.say(*held)
        self.say(severity, text)
        for station, telemetry in enumerate(self.telemetry):
            if telemetry.streams(dialect.MAVLINK_MSG_ID_FTC_EVENTS):
                self._queue([telemetry.make(dialect.MAVLINK_MSG_ID_FTC_EVENTS)], station)

    def say(self, severity: int, text: str) -> None:
        """Queue a STATUSTEXT."""
        self._texts += 1
        self._queue(text_chunks(severity, text, self._texts))

    # messages out

    def gcs_messages(self, station: int = 0, most: int | None = None) -> list[MAVLink_message]:
        """Hand over what is to be sent to a ground station; `most`: no more than so many."""
        messages = self._gcs_outboxes[station][:most]
        del self._gcs_outboxes[station][: len(messages)]
        return messages

    @property
    def has_gcs_messages(self) -> bool:
        """Whether some are left to hand over."""
        return any(self._gcs_outboxes)

    def next_telemetry_us(self) -> int:
        """Return when the next message is due, by its clock [µs]; far away if none is."""
        return min(telemetry.next_due_us() for telemetry in self.telemetry)

    def next_check_step(self) -> int:
        """Return the step after which fence or actuators are to be checked; far away if not."""
        return min(self._plan.fence.next_step, self._failsafe.next_step)

    def most_per_step(self, step_us: int) -> int:
        """Return messages per control period [µs] to a ground station that sustain all rates."""
        return max(telemetry.most_per_step(step_us) for telemetry in self.telemetry)

    def simulator_messages(self) -> list[MAVLink_message]:
        """Hand over what is to be sent to the simulator component."""
        messages, self._simulator_outbox = self._simulator_outbox, []
        return messages

    # inside

    def _advance_clock(self, now: float) -> None:
        self._clock.advance(round(now * 1e6), self._hot.time_us, self._hot.running)

    def _handlers(self) -> dict[int, Handler]:
        modes, mission = self.modes, self._plan.mission
        take_off, land = dialect.MAV_CMD_NAV_VTOL_TAKEOFF, dialect.MAV_CMD_NAV_VTOL_LAND
        return {
            dialect.MAV_CMD_COMPONENT_ARM_DISARM: self._arm_or_disarm,
            dialect.MAV_CMD_DO_FENCE_ENABLE: self._plan.fence.enable,
            dialect.MAV_CMD_DO_SET_MODE: lambda params: modes.set_mode(params[1]),
            dialect.MAV_CMD_NAV_LOITER_UNLIM: lambda _: modes.set_mode(LOITER),
            dialect.MAV_CMD_NAV_RETURN_TO_LAUNCH: lambda _: modes.set_mode(RTL),
            dialect.MAV_CMD_DO_CHANGE_SPEED: modes.change_speed,
            dialect.MAV_CMD_MISSION_START: mission.start,
            dialect.MAV_CMD_NAV_TAKEOFF: modes.take_off,
            dialect.MAV_CMD_DO_LAND_START: lambda _: modes.land(),
            dialect.MAV_CMD_DO_GO_AROUND: self._runway.go_around,
            dialect.MAV_CMD_DO_SET_MISSION_CURRENT: mission.set_current,
            dialect.MAV_CMD_FTC_SET_SLOT: self._formation.set_slot,
            take_off: lambda _: modes.refuse_to(take_off),
            land: lambda _: modes.refuse_to(land),
            **self._requests.handlers(),
        }

    def _place_handlers(self) -> dict[int, PlaceHandler]:
        return {
            dialect.MAV_CMD_NAV_LAND: self._guided.land,
            dialect.MAV_CMD_DO_REPOSITION: self._guided.reposition,
            dialect.MAV_CMD_DO_SET_HOME: self._set_home,
        }

    def _set_home(self, message: CommandMessage) -> int:
        result = self._guided.set_home(message)
        if result == dialect.MAV_RESULT_ACCEPTED:
            self._plan.note_home()
            for station in self._stations:
                home = self.telemetry[station].make(dialect.MAVLINK_MSG_ID_HOME_POSITION)
                self._queue([home], station)
        return result

    def _arm_or_disarm(self, params: tuple[float, ...]) -> int:
        objection = self._plan.fence.objection()
        if params[0] == 1.0 and objection is not None and not self.modes.armed:
            self.say(dialect.MAV_SEVERITY_WARNING, f"Arm: {objection}")
            return dialect.MAV_RESULT_DENIED
        return self.modes.arm_or_disarm(params)

    def _queue(
        self, messages: Iterable[MAVLink_message | None], station: int | None = None
    ) -> None:
        """Queue messages for a ground station; None: for all."""
        for number in self._stations if station is None else (station,):
            self._gcs_outboxes[number] += [one for one in messages if one is not None]

    def _collect(self) -> None:
        """Announce what happened to parameters, and gather what the services have to send."""
        for event in self._params.events():
            match event:
                case ParamChanged(name, value):
                    self.say(dialect.MAV_SEVERITY_INFO, f"{name} is {value:g} now")
                case ParamRenamed(before, name):
                    self.say(dialect.MAV_SEVERITY_WARNING, renamed.text_of(before, name))
                case ParamRefused(_, text):
                    self.say(dialect.MAV_SEVERITY_WARNING, text)
        self._queue(self._commands.gcs_messages())
        self._queue(self._params.messages_to_send())
        for message, station in self._plan.messages_to_send():
            self._queue([message], station)
        self._simulator_outbox += self._commands.simulator_messages()

    def _report_changes(self) -> None:
        """Announce what has changed since the last report."""
        own = self._resumption, self._edges, self._old_states, self._plan.fence, self._runway
        services = (*own, self._failsafe, self._controller, self._diagnosis, self._estimator)
        changes = chain.from_iterable(each.changes() for each in (*services, self._formation))
        for severity, text in self._changes.bounded(changes, self._hot.time_us):
            self.say(severity, text)
