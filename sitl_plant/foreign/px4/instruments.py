"""What PX4 is sent of its aircraft: HIL_SENSOR of each IMU, HIL_GPS, HIL_STATE_QUATERNION.

Written from PX4's description of its simulator interface (docs.px4.io, Simulation) and from what
its module simulator_mavlink does with each message, where the former is silent:

- the HIL_SENSOR with id 0 sets PX4's clock, so it is the first of a frame;
- a sensor counts as new if all its bits of fields_updated are set;
- HIL_GPS is taken as of now; eph and epv are accuracies [cm];
- HIL_STATE_QUATERNION is for logs: accelerations are thousandths of a m/s², north, east, down,
  without gravity (MAVLink has them in mG, PX4 reads them so).
"""

from collections.abc import Iterator
from functools import partial

import numpy as np

from mavlink_defs import dialect
from mavlink_defs.framing.codec import MessageId, payload_dtype
from mavlink_defs.framing.frames import FramePacker
from mavlink_defs.origin import Origin, degrees_at
from mavlink_defs.runtime.jit import compiled, in_python
from sitl_plant import vec3 as vectors
from sitl_plant.airframe import rigid_body
from sitl_plant.airframe.quaternion import quaternion
from sitl_plant.sensing.config import NavigationSensors
from sitl_plant.sensing.failures import Failures
from sitl_plant.sensing.sense import Sensing, sense, sensing_of
from sitl_plant.vec3 import Vec3

HIL_STATE = payload_dtype(dialect.MAVLink_hil_state_quaternion_message)

_SYSTEM = 1  # PX4 asks nobody's; its simulators send as these
_COMPONENT = 200
_R1, _mul = in_python(rigid_body.R1), in_python(vectors.mul)
_norm, _sub = in_python(vectors.norm), in_python(vectors.sub)
_HEARTBEAT_US = 1_000_000
_I2, _U2 = 32767, 65535


class Instruments:
    """The sensors of one aircraft as PX4 is sent them, frame by frame.

    `note` takes the truth of each control period, and samples what is due; `frame` makes a frame of
    all that is new since the one before.
    """

    def __init__(
        self,
        sensors: NavigationSensors,
        origin: Origin,
        density_kg_m3: float,
        gravity_m_s2: float,
        system: int,
        seed: int,
        step_us: int,
    ) -> None:
        """Take the sensors before their first sample.

        Args:
            sensors: What the aircraft carries.
            origin: Where north = east = down = 0 is.
            density_kg_m3: Of the air that it flies in.
            gravity_m_s2: Acceleration of gravity.
            system: The aircraft's system id.
            seed: Of the errors of its sensors.
            step_us: Control period [µs].
        """
        self._new = partial(sensing_of, sensors, origin, {system: density_kg_m3}, seed, step_us)
        self._truth = np.zeros(1, HIL_STATE)[0]
        self._origin, self._gravity = origin, gravity_m_s2
        self._sensing = self._new()
        self.restart(0)
        self._packer = FramePacker(_SYSTEM, _COMPONENT)
        self._heartbeat_us = 0

    def restart(self, time_us: int) -> None:
        """Begin with the errors of a first step again, at a time of PX4's clock [µs].

        What is sent from here on does not depend on how long it has been running.
        """
        faults = self._sensing.faults.faults  # which somebody sets
        new = self._new()
        self._sensing = new._replace(faults=new.faults._replace(faults=faults))
        self._since_us = time_us
        self._updated = np.zeros(self._sensing.imus.shape[1], np.uint32)
        self._has_fix = False

    @property
    def failures(self) -> Failures:
        """The faults of its sensors."""
        return self._sensing.faults

    def note(self, step: int, motion: np.void) -> None:
        """Sample what is due in a control period.

        Args:
            step: Control periods since the sensors began.
            motion: The true motion, of dtype `codec.SIM_STATE`.
        """
        self._has_fix = sample(self._sensing, step, motion) or self._has_fix
        self._updated |= self._sensing.imus[0]["fields_updated"]
        self._motion = motion

    def frame(self, time_us: int, *, with_truth: bool) -> bytes:
        """Return the frames that PX4 is to be sent at a time of its clock [µs], in one piece."""
        return b"".join(self._frames(time_us, with_truth))

    def _frames(self, time_us: int, with_truth: bool) -> Iterator[bytes]:
        pack = self._packer.pack_payload
        for imu, updated in zip(self._sensing.imus[0].copy(), self._updated, strict=True):
            imu["time_usec"], imu["fields_updated"] = time_us, updated
            yield pack(MessageId.SENSOR, imu.tobytes())
        if self._has_fix:
            fix = self._sensing.gps[0].copy()
            fix["time_usec"] += self._since_us
            yield pack(MessageId.GPS, fix.tobytes())
        if with_truth:
            self._write_truth(time_us)
            yield pack(dialect.MAVLINK_MSG_ID_HIL_STATE_QUATERNION, self._truth.tobytes())
        if time_us >= self._heartbeat_us:
            self._heartbeat_us = time_us + _HEARTBEAT_US
            yield self._packer.pack(_heartbeat())
        self._updated[:] = 0
        self._has_fix = False

    def _write_truth(self, time_us: int) -> None:
        motion, truth = self._motion, self._truth
        position, attitude = _floats(motion["position"]), _floats(motion["attitude"])
        to_earth = _R1(attitude)
        velocity = _mul(to_earth, _floats(motion["velocity"]))
        force = _mul(to_earth, _floats(motion["specific_force"]))
        acceleration = force[0], force[1], force[2] + self._gravity
        airspeed = _norm(_sub(_floats(motion["velocity"]), _floats(motion["wind"])))
        latitude, longitude = degrees_at(
            position[0], position[1], self._origin.latitude_deg, self._origin.longitude_deg
        )
        truth["time_usec"] = time_us
        truth["attitude_quaternion"] = quaternion(attitude)
        truth["rollspeed"], truth["pitchspeed"], truth["yawspeed"] = motion["rates"]
        truth["lat"], truth["lon"] = round(latitude * 1e7), round(longitude * 1e7)
        truth["alt"] = round((self._origin.altitude_m - position[2]) * 1e3)
        for name, value in zip(("vx", "vy", "vz"), velocity, strict=True):
            truth[name] = _within(value * 100.0, -_I2, _I2)
        truth["true_airspeed"] = truth["ind_airspeed"] = _within(airspeed * 100.0, 0, _U2)
        for name, value in zip(("xacc", "yacc", "zacc"), acceleration, strict=True):
            truth[name] = _within(value * 1e3, -_I2, _I2)


@compiled
def sample(sensing: Sensing, step: int, motion: np.void) -> bool:
    """Sample what is due of the first aircraft, as `sense` does; for callers in Python."""
    return bool(sense(sensing, 0, step, motion))


def _heartbeat() -> dialect.MAVLink_heartbeat_message:
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_GENERIC, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
    )


def _floats(values: np.ndarray) -> Vec3:
    x, y, z = values.tolist()
    return x, y, z


def _within(value: float, low: int, high: int) -> int:
    return min(max(round(value), low), high)
