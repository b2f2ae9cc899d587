"""Event-triggered neighbour messages on the wire: counted, of the same bytes, bit for bit the same.

The datagrams pass a relay of the flight. They are read here by the layout of MAVLink 2 alone, as
any sniffer could; no counter or codec of this project takes part.
"""

import struct
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flying import scenario_tree

from gcs.fleet import processes
from gcs.fleet.flight import fly_and_record
from gcs.fleet.in_process import fly_in_process
from gcs.fleet.relays import relay_of
from gcs.results.figures import FlightSummary
from gcs.results.recording import Recording
from gcs.results.summary import summarise
from gcs.scenario.bundled import find_scenario
from gcs.scenario.model import Scenario, scenario_of
from gcs.scenario.model import scenario_tree as gcs_tree
from mavlink_defs.capture.relay import Relay
from mavlink_defs.framing.signing import make_key

pytestmark = pytest.mark.sitl

STATE, NEIGHBOUR, ACTUATORS = 53100, 53102, 93
RUNNING, ENDED = 1, 4


class Sniffer:
    """Messages and bytes of each UAV, by kind; what was sent again counts once."""

    def __init__(self) -> None:
        self.messages: Counter[tuple[str, int]] = Counter()
        self.bytes: Counter[tuple[str, int]] = Counter()
        self._seen: set[tuple[int, int, int]] = set()

    def __call__(self, link: str, direction: str, datagram: bytes) -> bool:
        """Count a datagram and let it pass."""
        system, (low, high) = datagram[5], struct.unpack("<HB", datagram[7:10])
        number = low | high << 16
        payload = datagram[10 : 10 + datagram[1]].ljust(255, b"\0")
        if number == NEIGHBOUR:
            (step,) = struct.unpack_from("<I", payload, 64)
            if step > 0:
                self._count("neighbour_messages", system, datagram)
        elif number == STATE:
            step, flags = struct.unpack_from("<IB", payload, 136)
            if flags & (RUNNING | ENDED) == RUNNING:
                self._count_once("states", number, system, step, datagram)
        elif number == ACTUATORS:
            (time_us,) = struct.unpack_from("<Q", payload)
            self._count_once("actuator_messages", number, system, time_us, datagram)
        return True

    def _count_once(self, kind: str, number: int, system: int, key: int, datagram: bytes) -> None:
        if (number, system, key) not in self._seen:
            self._seen.add((number, system, key))
            self._count(kind, system, datagram)

    def _count(self, kind: str, system: int, datagram: bytes) -> None:
        self.messages[kind, system] += 1
        self.bytes[kind, system] += len(datagram)


def scenario_with(folder: Path, trigger: dict[str, float] | None, **changes: Any) -> Scenario:
    links = {
        "formation": {"trigger": trigger},
        "impairments": {"plant": {}, "formation": {}},
        **changes.pop("links", {}),
    }
    return scenario_of(folder / "s.yaml", scenario_tree(duration_s=0.8, links=links, **changes))


def fly_sniffed(
    scenario: Scenario, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> tuple[Recording, Sniffer]:
    """Fly over UDP, in lockstep, past a sniffer."""
    sniffers: list[Sniffer] = []

    def sniffed(on_ports: Scenario, _gate: None) -> Relay:
        sniffers.append(Sniffer())
        return relay_of(on_ports, sniffers[-1])

    monkeypatch.setattr(processes, "relay_of", sniffed)
    folder.mkdir(exist_ok=True)
    return fly_and_record(scenario, folder), sniffers[-1]


def assert_counts_are_what_was_sniffed(summary: FlightSummary, sniffer: Sniffer) -> None:
    for uav in summary.uavs:
        reported = {
            "states": summary.steps,
            "actuator_messages": uav.actuator_messages,
            "neighbour_messages": uav.neighbour_messages,
        }
        for kind, messages in reported.items():
            assert sniffer.messages[kind, uav.id] == messages, (kind, uav.id)
            assert sniffer.bytes[kind, uav.id] == uav.link_bytes[kind], (kind, uav.id)


@pytest.mark.parametrize("trigger", [None, {}])
def test_messages_of_a_formation_are_those_on_the_wire(
    trigger: dict[str, float] | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An actuator is lost on the way, so the report on the members grows; slots change, too."""
    tree = gcs_tree("missions/hexagon")
    changes = [{"at_s": 0.5, "slots": {3: {"right_m": -30.0}}}]
    tree["formation"] |= {"on_lost": "widen", "changes": changes}
    fault = {"uav": 2, "actuator": "aileron", "stuck_deg": 15.0, "start_s": 1.5}
    links = {"formation": {"trigger": trigger}, "impairments": {"plant": {}, "formation": {}}}
    tree |= {"duration_s": 2.0, "faults": [fault], "links": links}
    scenario = scenario_of(find_scenario("missions/hexagon"), tree)
    flown, sniffer = fly_sniffed(scenario, tmp_path / "run", monkeypatch)
    computed = fly_in_process(scenario)
    assert computed.signals["report_size"][-1].min() == 2  # all know of the second member
    assert np.isfinite(computed.signals["path_position"]).all()
    assert flown.signals.tobytes() == computed.signals.tobytes()
    assert np.array_equal(flown.states, computed.states)
    assert_counts_are_what_was_sniffed(summarise(computed, scenario), sniffer)


@pytest.mark.parametrize("case", ["triggered", "every step", "signed in a gust"])
def test_messages_and_bytes_are_those_on_the_wire(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if case == "signed in a gust":
        make_key(tmp_path / "key")
        gust = {"gust": {"start_s": 0.3, "duration_s": 0.3, "down_m_s": -2.0}}
        links = {"signing_key": str(tmp_path / "key")}
        scenario = scenario_with(tmp_path, {}, wind=gust, links=links)
    else:
        scenario = scenario_with(tmp_path, {} if case == "triggered" else None)
    flown, sniffer = fly_sniffed(scenario, tmp_path / "run", monkeypatch)
    computed = fly_in_process(scenario)
    assert flown.signals.tobytes() == computed.signals.tobytes()
    assert np.array_equal(flown.states, computed.states)
    summary = summarise(computed, scenario)
    assert_counts_are_what_was_sniffed(summary, sniffer)
    assert summarise(flown, scenario).uavs == summary.uavs
    if case == "every step":
        assert [uav.neighbour_messages for uav in summary.uavs] == [2 * 799, 799, 799]
        assert summary.neighbour_saving == 0.0
    else:
        assert summary.neighbour_saving is not None
        assert summary.neighbour_saving > 0.9
