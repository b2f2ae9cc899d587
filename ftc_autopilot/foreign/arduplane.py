"""An ArduPlane SITL by its JSON interface, as one of the fleet.

Its frames are the plant's steps: it is given the state of a step, and what it answers is commanded
at that step. Until the flight begins it is held on a launcher, at rest, by a clock of its own.
"""

import contextlib
import math
import time

import numpy as np

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.foreign.base import Conversation, ForeignError, ForeignInputError, PlantStep
from ftc_autopilot.foreign.by_hand import arguments, instruction, waiting
from ftc_autopilot.foreign.child import Child
from ftc_autopilot.kinds import ArduPlaneAutopilot
from mavlink_defs.endpoint import UdpAddress, bind_udp, free_ports
from sitl_plant.airframe.aircraft import aircraft_record
from sitl_plant.foreign.ardupilot.instruments import JsonInstruments
from sitl_plant.foreign.ardupilot.launch import AircraftLaunch, new_launch, out_of_body
from sitl_plant.foreign.ardupilot.outputs import Outputs
from sitl_plant.foreign.ardupilot.peer import Frame, Peer
from sitl_plant.foreign.ardupilot.protocol import Measured, answer, steps_of
from sitl_plant.vec3 import Vec3

_NO_LOGS = "LOG_BACKEND_TYPE 0\n"
"""They would go with its folder, and a thread that writes them knows no clock but the wall's."""
_TURN_S = 0.02
_WAIT_S = 0.5  # between two looks whether it runs
_AGAIN_S = 1.0  # it repeats a frame after 1.1 s: earlier, the answer has crossed the repetition
_UNSUPPRESSED_S = 2.5  # after arming: its motor stands still for 2 s
_BEGAN_S = 1_767_225_600  # 2026-01-01, from which its GPS counts: the same in each flight
_STARTS_S = 10.0  # its clock, which runs by the wall until its first frame, jumps there with it
_AHEAD = 1000  # times real time: its clock is the plant's, which sets the pace
_SETTLED_S = 2.0  # its first frames come before it has read its parameters [s of its time]
_NEAR = 0.01  # relative difference of a frame from what it asks for that is not worth a word
_MAX_DATAGRAM = 2048


class ArduPlane:
    """One ArduPlane SITL."""

    def __init__(self, config: AutopilotConfig, vehicle_link: UdpAddress) -> None:
        """Prepare it; `begin` starts it, or waits for one that is started by hand.

        Args:
            config: The configuration of its bridge.
            vehicle_link: Where it is to send its MAVLink.

        Raises:
            EndpointError: The port where that one finds its physics cannot be used.
        """
        assert isinstance(config.autopilot, ArduPlaneAutopilot)
        self._config, self._own = config, config.autopilot
        self._link = vehicle_link
        self._peer = Peer()
        self._instruments = JsonInstruments(
            config.sensors,
            config.aircraft.air_density_kg_m3,
            config.id,
            config.sensor_seed,
            config.step_us,
        )
        self.failures = self._instruments.failures
        self._outputs = Outputs(self._own.outputs, aircraft_record(config.aircraft))
        self.notices: list[str] = []
        at = waiting(config)
        self._physics = UdpAddress("127.0.0.1", 0) if at is None else at.physics
        hint = "choose others with autopilot.port"
        self._sock = bind_udp(self._physics, f"physics of UAV {config.id}", hint)
        self._child = Child("ArduPlane", config.id)
        self._asked_s = 0.0  # when it was answered last, by the wall clock
        self._launch: AircraftLaunch | None = None
        self._held = 0  # control periods of its clock before the flight
        self._started = 0  # of these, when it was started last
        self._odd_rate_hz = 0  # that its frames cannot have, and that is said
        self._launched: int | None = None  # of these, when the launch began
        self._armed: int | None = None
        self._waits = False  # it has sent a frame that is not answered
        self._due = 0  # step at which that is to be answered
        self._frame_steps = 1
        self._answer, self._again_s = b"", 0.0
        self._time_s: float | None = None  # of the flight, for messages
        self._paced: tuple[float, int] | None = None  # wall time and `_held` since it is ready
        self._until = 0  # of these, as long as which it may answer a station
        self._first = 0  # step at which the flight begins

    def begin(self, first: PlantStep) -> None:
        """Start it, and hold the aircraft on its launcher."""
        config, state = self._config, first.state
        if state is None:
            text = "ArduPlane makes its own sensors of the true state: set navigation: true_state"
            raise ForeignInputError(f"UAV {config.id}: {text}")
        self._first = self._due = first.step
        self._asked_s = time.monotonic()
        self._start()
        x = np.concatenate([state[name] for name in ("position", "velocity", "attitude", "rates")])
        acceleration, period_s = self._own.outputs.launch_acceleration_m_s2, config.step_us / 1e6
        steps = math.ceil(float(np.linalg.norm(state["velocity"])) / acceleration / period_s)
        gravity = float(aircraft_record(config.aircraft)["g"])
        self._launch = new_launch(x, state["wind"], gravity, steps * period_s)

    def _start(self) -> None:
        """Start it, or say how it is started."""
        if self._own.binary is None:
            self.notices.append(instruction(self._config))
            return
        rc_port, base_port = free_ports(2)
        physics = UdpAddress("127.0.0.1", self._sock.getsockname()[1])
        self._child.start(
            self._own.binary,
            [
                *arguments(
                    self._config, physics, self._link, self._child.folder / "derived.parm", _NO_LOGS
                ),
                "--start-time", str(_BEGAN_S),
                "--rc-in-port", str(rc_port),
                "--base-port", str(base_port),
                "--serial1", "none:", "--serial2", "none:",
                "--speedup", str(_AHEAD),
            ],
        )  # fmt: skip

    def hold(self, talk: Conversation) -> bool:
        """Let its clock run on; return whether its launch is over."""
        end = time.monotonic() + _TURN_S
        self._check_ready(talk.is_ready)
        while (left := end - time.monotonic()) > 0.0:
            if self._waits:
                talk.exchange(self._own_time_s)
                if not talk.is_armed:
                    self._armed = None
                elif self._armed is None:
                    self._armed = self._held
                if self._may_run(talk):
                    if self._is_launched():
                        return True
                    self._reply(self._on_launcher())
                    self._held += self._frame_steps
            self._receive(left)
        return False

    @property
    def _own_time_s(self) -> float:
        return self._held * self._config.step_us / 1e6

    def _may_run(self, talk: Conversation) -> bool:
        """Return whether its clock may run on.

        Stations talk to it once it is ready. It runs for their messages alone, as long for each as
        its answer takes: so it has the same time at each in every flight. One that is started by
        hand keeps to the wall clock.
        """
        if self._armed is not None or not talk.is_ready:
            return True
        if self._own.binary is None:  # somebody flies it, who may have a link of his own to it
            while talk.release():
                pass
            return not self._is_ahead()
        if self._held >= self._until:
            takes_s = talk.release()
            self._until = self._held + math.ceil(takes_s * 1e6 / self._config.step_us)
            talk.exchange(self._own_time_s)
        return self._held < self._until

    def _is_ahead(self) -> bool:
        """Return whether it is ahead of the wall clock, by which an operator times it."""
        now = time.monotonic()
        if self._paced is None:
            self._paced = now, self._held
        since, held = self._paced
        return (self._held - held) * self._config.step_us / 1e6 > now - since

    def _check_ready(self, ready: bool) -> None:
        self._child.check()
        self._check_silence("before the flight")
        passed_s = (self._held - self._started) * self._config.step_us / 1e6
        limit_s = self._own.ready_within_s
        if not ready and passed_s > limit_s:
            text = f"ArduPlane is not ready to be armed after {limit_s:g} s of its time"
            raise ForeignError(text)
        if passed_s > _SETTLED_S:
            self._check_rate()

    def _check_silence(self, when: str) -> None:
        limit_s = self._own.answers_within_s
        if not self._waits and time.monotonic() - self._asked_s > limit_s:
            text = f"ArduPlane has been silent for {limit_s:g} s {when}"
            raise ForeignError(f"{text}; {self._peer.describe()}")

    def _check_rate(self) -> None:
        """Say once if its frames are not as long as it asks for."""
        rate_hz = self._peer.packet.rate_hz if self._peer.packet else 0
        step_us, steps = self._config.step_us, self._frame_steps
        off = abs(steps * step_us * rate_hz / 1e6 - 1.0)
        if off < _NEAR or rate_hz in {0, self._odd_rate_hz}:
            return
        self._odd_rate_hz = rate_hz
        self.notices.append(
            f"ArduPlane asks for steps of {1e6 / rate_hz:.0f} us (SIM_RATE_HZ {rate_hz}) and gets "
            f"{steps * step_us} us, whole control periods of {step_us} us: its clock follows"
        )

    def _is_launched(self) -> bool:
        """Return whether the flight begins now; launch it when its motor may turn."""
        if self._armed is None or self._launch is None:
            return False
        period_s = self._config.step_us / 1e6
        stands = self._launch.duration_s == 0.0
        if (self._held - self._armed) * period_s < (0.0 if stands else _UNSUPPRESSED_S):
            return False
        if self._launched is None:
            self._launched = self._held
        return (self._held - self._launched) * period_s >= self._launch.duration_s

    def _on_launcher(self) -> Measured:
        assert self._launch is not None
        period_s = self._config.step_us / 1e6
        since = -1 if self._launched is None else self._held - self._launched
        return self._launch.at(since * period_s, _STARTS_S + self._own_time_s)

    def exchange(self, sent: PlantStep) -> np.ndarray:
        """Answer its frame with the state of a step, and return what it commands then."""
        state = sent.state
        assert state is not None
        if sent.step < self._due:  # its frames are longer than a control period
            return self._outputs.shares
        period_s = self._config.step_us / 1e6
        self._time_s = sent.time_us / 1e6
        attitude, velocity, wind = (_floats(state[n]) for n in ("attitude", "velocity", "wind"))
        motion = Measured(
            time_s=_STARTS_S + (self._held + sent.step - self._first) * period_s,
            rates=_floats(state["rates"]),
            specific_force=_floats(state["specific_force"]),
            position=_floats(state["position"]),
            attitude=attitude,
            velocity=out_of_body(velocity, attitude),
            airspeed=math.dist(velocity, wind),
            wind=out_of_body(wind, attitude),
        )
        self._reply(self._instruments.shown(sent.step, self._time_s, motion))
        while not self._waits:
            self._receive(_WAIT_S)
            if not self._waits:
                self._child.check(self._time_s)
                self._check_silence(f"at {self._time_s:.3f} s")
        self._due = sent.step + self._frame_steps
        return self._outputs.shares

    def _reply(self, measured: Measured) -> None:
        """Answer the frame that waits."""
        self._answer, self._waits = answer(measured), False
        self._asked_s = time.monotonic()
        self._send()
        self._again_s = time.monotonic() + _AGAIN_S

    def _send(self) -> None:
        if self._peer.address is not None:
            with contextlib.suppress(OSError):  # it has ended, which `check` says
                self._sock.sendto(self._answer, self._peer.address)

    def _receive(self, timeout_s: float) -> None:
        """Take in one of its frames, if one comes in time [s]."""
        self._sock.settimeout(max(timeout_s, 1e-4))
        try:
            datagram, address = self._sock.recvfrom(_MAX_DATAGRAM)
        except OSError:  # none came
            return
        match self._peer.receive(datagram, address, time.monotonic()):
            case Frame.RESTARTED if self._time_s is not None:
                text = f"ArduPlane was started again at {self._time_s:.3f} s"
                raise ForeignError(f"{text}: start the flight again")
            case Frame.NEW | Frame.RESTARTED as frame:
                if frame is Frame.RESTARTED:
                    self._started = self._held
                packet = self._peer.packet
                assert packet is not None
                self._outputs.receive(packet.pulses_us)
                self._frame_steps = steps_of(packet.rate_hz, self._config.step_us)
                self._waits = True
            case Frame.REPEATED if not self._waits and time.monotonic() > self._again_s:
                self._send()  # its answer was lost

    def close(self) -> None:
        """End it, if it was started here."""
        if self._peer.packet is not None:
            self.notices.append(f"ArduPlane: {self._peer.describe()}")
        self._child.close()
        self._sock.close()


def _floats(values: np.ndarray) -> Vec3:
    x, y, z = values.tolist()
    return x, y, z
