"""Operations on one vehicle by MAVLink's microservices: commands, faults, profile, parameters.

Every operation returns, or raises `CommandRefused` (with the vehicle's reason) or `NoAnswer`
(after several retries).
"""

import contextlib
import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Self

from gcs.console.errors import BadInput, CommandRefused, NoAnswer
from gcs.station.given import fault_of
from gcs.station.notifications import INFO, WARNING, Notification, enum_name
from gcs.station.plan_transfers import PlanTransfers
from gcs.station.subscriptions import Subscription
from gcs.station.telemetry import REQUESTED_S
from gcs.station.vehicle_link import Progress
from mavlink_defs import dialect
from mavlink_defs.constants import ACTUATORS, FORCE_DISARM, MODE_NAMES
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.faults import FAMILY_OF
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.sensors import SENSOR_NAMES
from mavlink_defs.services.command import CommandFinished
from mavlink_defs.services.fault_list import FaultLister, FaultsListed
from mavlink_defs.services.param import Param, ParamFinished, ParamLister, ParamReader, ParamSetter

if TYPE_CHECKING:
    from gcs.station.navigation import KnownHome

_TRIES = 3
_MESSAGE_S = 1.0  # for a message after its acknowledgement


class Vehicle(PlanTransfers):
    """One vehicle; each operation returns once it has answered.

    Operations raise `gcs.errors.CommandRefused` if it refuses and `gcs.errors.NoAnswer` if it does
    not answer.

    Attributes:
        id: Its system id; `system` is the same.
        state: What is known of it: mode, arming, latest messages, event counts, faults, mission.
        patience: How long operations wait for its answers.
    """

    def __repr__(self) -> str:
        return f"<UAV {self.id}>"

    @property
    def vehicle(self) -> Self:
        """Itself; once, the general calls were in an object of their own."""
        return self

    def messages(self, name: str | None = None) -> Subscription[MAVLink_message]:
        """Subscribe to its messages of a name, such as "ATTITUDE"; None for all."""
        return self._received.subscribe(
            lambda message: (
                message.get_srcSystem() == self.id and name in {None, message.get_type()}
            )
        )

    # commands

    async def command(self, number: int, params: Iterable[float] = ()) -> None:
        """Send a COMMAND_LONG: a MAV_CMD and up to seven parameters, the others 0."""
        seven = (*params, *[0.0] * 7)[:7]
        message = dialect.MAVLink_command_long_message(*self._address, number, 0, *seven)
        what, ok = enum_name("MAV_CMD", number), dialect.MAV_RESULT_ACCEPTED
        done, reasons = await self._run(
            "command",
            self._commands,
            lambda now: self._commands.send(message, now),
            CommandFinished,
            stop=self._commands.cancel,
        )
        self._judge(what, done.result, ok, "MAV_RESULT", reasons)

    async def arm(self) -> None:
        """Arm; simulated time begins when the last vehicle of the fleet is armed."""
        await self.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,))

    async def disarm(self, force: bool = False) -> None:
        """Disarm; in flight only with `force`, which cuts the thrust."""
        params = (0.0, FORCE_DISARM if force else 0.0)
        await self.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, params)

    async def start_mission(self) -> None:
        """Start flying the mission, or the profile."""
        await self.command(dialect.MAV_CMD_MISSION_START)

    async def set_mode(self, mode: str) -> None:
        """Change the mode: "AUTO", "LOITER", "RTL" or "GUIDED".

        Raises:
            BadInput: It is none of them.
        """
        numbers = {name: number for number, name in MODE_NAMES.items()}
        if (number := numbers.get(mode)) is None:
            raise BadInput(f"mode: expected {', '.join(numbers)}, got {mode!r}")
        custom = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        await self.command(dialect.MAV_CMD_DO_SET_MODE, (custom, number))

    async def set_interval(self, message_id: int, interval_s: float) -> None:
        """Request a message every `interval_s`; 0 is the vehicle's default, negative is never."""
        params = (message_id, interval_s * 1e6 if interval_s >= 0.0 else -1.0)
        await self.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, params)

    async def ask_for_private(self) -> None:
        """Request its private messages; a refused one is not requested again."""
        try:
            for message_id, interval_s in REQUESTED_S.items():
                await self.set_interval(message_id, interval_s)
        except CommandRefused:
            self.state.offers_private = False
        except NoAnswer:
            pass  # later
        self.state.learn_private(self._now())

    async def request(self, message_id: int) -> None:
        """Request one message now; `state.latest` has it when this returns.

        It may come before its acknowledgement or after it; one that is lost is requested again.

        Raises:
            NoAnswer: It does not come, though its request is accepted.
        """
        coming = self._received.subscribe(
            lambda message: message.get_srcSystem() == self.id and message.get_msgId() == message_id
        )
        for _ in range(_TRIES):
            await self.command(dialect.MAV_CMD_REQUEST_MESSAGE, (message_id,))
            if await coming.comes_within(_MESSAGE_S):
                return
        name = dialect.mavlink_map[message_id].msgname
        raise self._no_answer(f"UAV {self.system} accepted to send {name}, which has not come")

    async def ask_for_fleet(self) -> None:
        """Request its fleet; `state.fleet` stays empty if it refuses or does not answer."""
        number = dialect.MAVLINK_MSG_ID_FTC_FLEET
        self.state.latest.pop(number, None)
        with contextlib.suppress(CommandRefused, NoAnswer):
            await self.request(number)

    async def home(self) -> "KnownHome":
        """Return where its home is.

        Raises:
            NoAnswer: It does not say.
        """
        from gcs.station.navigation import home_of

        if (home := home_of(self.state)) is None:
            await self.request(dialect.MAVLINK_MSG_ID_HOME_POSITION)
            home = home_of(self.state)
        if home is None:
            raise NoAnswer(f"UAV {self.system} does not say where its home is")
        return home

    async def enable_fence(self, enable: bool = True) -> None:
        """Let it watch its fence, or no longer."""
        await self.command(dialect.MAV_CMD_DO_FENCE_ENABLE, (float(enable),))

    # faults

    async def set_fault(
        self, /, actuator: str | Fault, *, start_s: float | None = None, **keys: float
    ) -> None:
        """Set an actuator fault, with the keys of a scenario's `faults`.

        Args:
            actuator: "aileron", "elevator", "rudder" or "throttle"; or all of a fault at once, also
                of a sensor.
            start_s: Start in simulated time, exclusive [s]; None for now.
            **keys: Such as `effectiveness`, `bias_deg`, `stuck_deg`, `frequency_hz`, `end_s`.

        Raises:
            BadInput: They do not describe a fault.
        """
        if isinstance(actuator, Fault):
            await self._set(actuator)
        else:
            await self._set(fault_of(actuator=actuator, start_s=start_s, **keys))

    async def set_sensor_fault(
        self,
        /,
        sensor: str,
        failure: str | None = None,
        *,
        instance: int = 0,
        axis: str | None = None,
        start_s: float | None = None,
        **keys: float,
    ) -> None:
        """Set a fault of a navigation sensor, with the keys of a scenario's `faults`.

        Args:
            sensor: "gyro", "accelerometer", "magnetometer", "barometer", "gps" or "airspeed".
            failure: "off", "stuck", "garbage", "wrong", "slow", "delayed" or "intermittent"; None
                if a value says it.
            instance: Number of the sensor from 1; 0 for all.
            axis: "x", "y" or "z" of what is wrong; None for all.
            start_s: Start in simulated time, exclusive [s]; None for now.
            **keys: Such as `bias_deg_s`, `fade_s`, `noise_factor`, `end_s`.

        Raises:
            BadInput: They do not describe a fault.
        """
        given = {"failure": failure, "instance": instance, "axis": axis, "start_s": start_s}
        await self._set(fault_of(sensor=sensor, **given, **keys))

    async def _set(self, fault: Fault) -> None:
        await self.command(fault.family.command, fault.params)

    async def clear_faults(self, actuator: str | int | None = None) -> None:
        """Clear the faults of one actuator, by name or index, or all, of sensors too.

        Raises:
            BadInput: There is no such actuator.
        """
        if isinstance(actuator, str):
            if actuator not in ACTUATORS:
                raise BadInput(f"actuator: expected {', '.join(ACTUATORS)}, got {actuator!r}")
            actuator = ACTUATORS.index(actuator)
        which = -1.0 if actuator is None else float(actuator)
        await self.command(dialect.MAV_CMD_FTC_CLEAR_FAULTS, (which,))

    async def clear_sensor_faults(self, sensor: str, instance: int = 0) -> None:
        """Clear the faults of a sensor; an instance of 0 is all of them.

        Raises:
            BadInput: There is no such sensor.
        """
        if sensor not in SENSOR_NAMES:
            raise BadInput(f"sensor: expected {', '.join(SENSOR_NAMES)}, got {sensor!r}")
        unit = FAMILY_OF[sensor].named(sensor).failure_unit
        params = (unit, dialect.FAILURE_TYPE_OK, instance)
        await self.command(dialect.MAV_CMD_INJECT_FAILURE, params)

    async def set_slot(self, ahead_m: float, right_m: float, up_m: float) -> None:
        """Change its slot in the formation, relative to the path [m]; all NaN: the planned one."""
        await self.command(dialect.MAV_CMD_FTC_SET_SLOT, (ahead_m, right_m, up_m))

    async def formation(self) -> dialect.MAVLink_ftc_formation_message:
        """Request how it sees its formation."""
        number = dialect.MAVLINK_MSG_ID_FTC_FORMATION
        await self.request(number)
        message: dialect.MAVLink_ftc_formation_message = self.state.latest[number]
        return message

    async def faults(self) -> tuple[Fault, ...]:
        """Request its faults, past and future ones too; `state.faults` holds them from then on."""
        machine = FaultLister(self._own, self._address)
        done, reasons = await self._run("command", machine, machine.start, FaultsListed)
        ok = dialect.MAV_RESULT_ACCEPTED
        known = done.faults if done.result == ok else None
        self._emit(self.state.learn_faults(known, self._now()))
        self._judge("the request for its faults", done.result, ok, "MAV_RESULT", reasons)
        return done.faults

    async def ask_what_is_due(self) -> None:
        """Request faults, mission, and fence and rally points, if they are due.

        A request that the vehicle refuses is not repeated.
        """
        state = self.state
        if state.offers_faults and self._now() >= state.faults_due:
            try:
                await self.faults()
            except CommandRefused:
                state.offers_faults = False
            except NoAnswer:
                return  # later
        if state.offers_profile and self._now() >= state.profile_due:
            try:
                await self.download_mission()
            except CommandRefused:
                state.offers_profile = False
            except NoAnswer:
                return
        if state.offers_areas and self._now() >= state.areas_due:
            try:
                await self.download_fence()
                await self.download_rally()
            except CommandRefused:
                state.offers_areas = False
            except NoAnswer:
                return

    upload, download = PlanTransfers.upload_profile, PlanTransfers.download_profile  # older names
    list_faults = faults

    # parameters

    async def list_params(self, progress: Progress | None = None) -> tuple[Param, ...]:
        """Read all parameters."""
        machine = ParamLister(self._own, self._address)
        done, _ = await self._run("param", machine, machine.start, ParamFinished, progress)
        self._judge_param("its parameters", done)
        return done.params

    async def get_param(self, name: str) -> Param:
        """Read one parameter.

        Raises:
            BadInput: The name is not a valid parameter name.
        """
        try:
            machine = ParamReader(self._own, self._address, name)
        except ValueError as problem:
            raise BadInput(f"parameter: {problem}") from problem
        done, _ = await self._run("param", machine, machine.start, ParamFinished)
        self._judge_param(name, done)
        return done.params[0]

    async def set_param(self, name: str, value: float) -> Param:
        """Set one parameter; return it as the vehicle then holds it.

        Raises:
            BadInput: The name is not valid, or the value is not of the parameter's type.
        """
        known = await self.get_param(name)
        if not math.isfinite(value) or (known.is_integer and value != int(value)):
            expected = "a whole number" if known.is_integer else "a finite number"
            raise BadInput(f"{name} of UAV {self.system}: expected {expected}, got {value:g}")
        machine = ParamSetter(self._own, self._address, Param(name, value, known.type))
        done, _ = await self._run("param", machine, machine.start, ParamFinished)
        self._judge_param(f"{name} = {value:g}", done)
        return done.params[0]

    def _judge_param(self, what: str, done: ParamFinished) -> None:
        if done.error is None:
            raise self._no_answer(
                f"UAV {self.system} offers no parameters: it did not answer the request for {what}"
            )
        if done.error != dialect.MAV_PARAM_ERROR_NO_ERROR:
            held = f"; it holds {done.params[0].value:g}" if done.params else ""
            reason = enum_name("MAV_PARAM_ERROR", done.error)
            text = f"UAV {self.system} refused {what} ({reason}){held}"
            self._emit([Notification(self._now(), self.system, "ack", WARNING, text)])
            raise CommandRefused(text, done.error)
        if len(done.params) == 1:
            param = done.params[0]
            text = f"{param.name} is {param.value:g}"
            self._emit([Notification(self._now(), self.system, "ack", INFO, text)])
