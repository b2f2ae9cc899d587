"""Messages of vehicles as messages of channels: units, counts, and what is not known."""

import json
import math
import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from plain_faults import actuator_fault
from tui_bench import heartbeat, sent

from gcs.fleet.foxglove.live_channels import LiveChannels, all_channels
from gcs.fleet.foxglove.scene import FormationScene, orientation
from gcs.results.channels import ChannelKind, encoded
from gcs.results.columns import COLUMNS
from gcs.station.fleet_state import FleetState
from gcs.station.notifications import WARNING, Notification
from mavlink_defs import dialect
from mavlink_defs.faults.kinds import FaultLimits
from sitl_plant.airframe.rigid_body import R1

LIMITS = FaultLimits(((-20.0, 20.0), (-30.0, 10.0), (0.0, 0.0)), 80.0)


class Bench:
    """A fleet that is heard, and the messages that come of it."""

    def __init__(self) -> None:
        self.fleet = FleetState()
        self.published: list[tuple[str, float, dict[str, Any]]] = []
        self.live = LiveChannels({1: LIMITS}, self._publish)
        self.live.fleet = self.fleet
        self.say(heartbeat(1))

    def _publish(
        self, kind: ChannelKind, system: int, time_s: float, make: Callable[[], Mapping[str, Any]]
    ) -> None:
        message = json.loads(encoded(make()))
        assert message.keys() == kind.fields.keys()
        self.published.append((kind.topic(system), time_s, message))

    def say(self, message: Any, system: int = 1) -> None:
        self.fleet.receive(sent(message, system), 0.0)
        self.live.receive(message)

    def of(self, topic: str) -> list[tuple[float, dict[str, Any]]]:
        return [(t, message) for name, t, message in self.published if name == topic]


def outputs(*shares: float) -> Any:
    return dialect.MAVLink_actuator_output_status_message(0, 15, [*shares, *[0.0] * 28])


def events(time_ms: int, *counts: int) -> Any:
    four = [0] * 4
    return dialect.MAVLink_ftc_events_message(time_ms, 100, list(counts), four, 0, four, 0)


def test_a_state_has_the_units_of_a_recording() -> None:
    bench = Bench()
    bench.say(dialect.MAVLink_attitude_message(0, 0.1, -0.2, 0.3, 0.01, 0.02, 0.03))
    bench.say(outputs(0.5, -0.5, 0.5, 0.25))
    bench.say(
        dialect.MAVLink_ftc_tracking_message(2500, [40.0, 90.0, 0, 0], [1.0, 0, 180.0, 0], [0] * 4)
    )
    ((time_s, state),) = bench.of("/uav1/state")
    assert time_s == 2.5
    assert state.keys() <= {column.name for column in COLUMNS}
    assert [state[name] for name in ("roll", "pitch", "yaw")] == pytest.approx([0.1, -0.2, 0.3])
    assert state["reference_airspeed"] == 40.0
    assert state["reference_roll"] == pytest.approx(math.pi / 2)
    assert state["error_pitch"] == pytest.approx(math.pi)
    held = [state[f"held_{name}"] for name in ("aileron", "elevator", "rudder", "throttle")]
    assert held == pytest.approx([*np.radians([10.0, -15.0, 0.0]), 20.0])
    assert state["north"] is state["path_position"] is None


def test_events_are_counted_and_published_once() -> None:
    bench = Bench()
    bench.say(outputs(0.5, 0.0, 0.0, 0.25))
    for message in (events(100, 2, 0, 0, 1), events(300, 2, 0, 0, 1), events(500, 5, 0, 0, 1)):
        bench.say(message)
    found = [(t, each["actuator"], each["count"]) for t, each in bench.of("/uav1/event")]
    assert found == [(0.1, "aileron", 2), (0.1, "throttle", 1), (0.5, "aileron", 5)]
    assert bench.of("/uav1/event")[1][1]["value"] == 20.0


def test_faults_are_those_that_act_now() -> None:
    bench = Bench()
    fault = actuator_fault(2, 0.9, 0.0, 0.0, 19.0, 22.0)
    bench.fleet.vehicles[1].faults = (fault,)
    for time_ms in (18_000, 20_000, 23_000):
        bench.say(events(time_ms, 0, 0, 0, 0))
    texts = [message["rudder"] for _, message in bench.of("/uav1/faults")]
    assert texts == ["none", fault.describe(), "none"]


def test_texts_have_a_level_and_a_name() -> None:
    bench = Bench()
    bench.say(events(1500, 0, 0, 0, 0))
    bench.live.notify(Notification(0.0, 1, "text", WARNING, "low"))
    bench.live.notify(Notification(0.0, 0, "link", 0, "gone"))
    (first, second) = [message for _, message in bench.of("/texts")]
    assert first["timestamp"] == {"sec": 1, "nsec": 500_000_000}
    assert (first["level"], first["message"], first["name"]) == (3, "low", "UAV 1")
    assert (second["level"], second["name"]) == (5, "link")


def test_others_are_not_published() -> None:
    bench = Bench()
    bench.say(heartbeat(9), 9)
    bench.say(events(100, 1, 1, 1, 1), 9)
    assert not bench.published
    assert len(all_channels([1, 2])) == 9


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (0.3, -0.4, 2.0), (-1.0, 0.7, -3.0)])
def test_the_orientation_turns_the_axes_of_the_aircraft(
    angles: tuple[float, float, float],
) -> None:
    """Compared with the rotation matrix of the plant, from forward, right, down to NED."""
    q = orientation(*angles)
    x, y, z, w = (float(each) for each in numbers_of(repr(q)))
    turned = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    to_enu = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    from_flu = np.diag([1.0, -1.0, -1.0])
    assert turned == pytest.approx(
        to_enu @ np.reshape(np.asarray([*R1(angles)], float), (3, 3)) @ from_flu
    )


def numbers_of(text: str) -> list[str]:
    return re.findall(r"[-+]?\d+\.\d+(?:e[-+]?\d+)?", text)


def test_a_scene_names_the_fault_of_a_vehicle() -> None:
    bench = Bench()
    bench.say(dialect.MAVLink_attitude_message(0, 0, 0, 0, 0, 0, 0))
    bench.say(dialect.MAVLink_local_position_ned_message(0, 1.0, 2.0, -3.0, 0, 0, 0))
    bench.say(events(1500, 0, 0, 0, 0))
    bench.fleet.vehicles[1].faults = (actuator_fault(2, 0.5, 0.0, 0.0, 0.0, math.inf),)
    entities, frames = FormationScene().update(bench.fleet.vehicles.values())
    assert b"UAV 1: rudder at 50 %" in entities.encode()
    assert b"uav1" in frames.encode()
    assert b"uav1" not in FormationScene().update([])[1].encode()
