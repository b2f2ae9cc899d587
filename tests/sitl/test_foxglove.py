"""`gcs up --foxglove`: a client of Foxglove's protocol reads a flight over UDP as it goes on."""

import asyncio
import json
import re
from pathlib import Path
from typing import Any

import pytest
from flying import run, scenario_tree
from foxglove_client import FoxgloveClient, foxglove_client
from station import BAD_INPUT, Up, failed, up
from test_web import free_port

from gcs.scenario.model import load_scenario

pytestmark = pytest.mark.sitl

FAULT = {"uav": 3, "actuator": "rudder", "effectiveness": 0.5, "start_s": 0.5}
TOPICS = {f"/uav{i}/{kind}" for i in (1, 2, 3) for kind in ("state", "location", "event", "faults")}


def test_a_client_reads_states_events_faults_and_texts(tmp_path: Path) -> None:
    address = f"127.0.0.1:{free_port()}"
    tree = scenario_tree(faults=[FAULT])
    with up(tmp_path / "fleet", "--foxglove-at", address, "--speed", "0.5", tree=tree) as fleet:
        client = asyncio.run(_read(address, fleet))
        assert fleet.stop()[0] == 0
    assert client.channels.keys() == TOPICS | {"/texts", "/formation", "/tf"}
    assert client.channels["/uav1/location"]["schemaName"] == "foxglove.LocationFix"
    assert client.channels["/formation"]["schemaName"] == "foxglove.SceneUpdate"
    _check_states(client, fleet)
    _check_events(client)
    assert client.messages["/uav3/faults"][-1][1]["rudder"].startswith("rudder at 50 %")
    assert client.messages["/uav3/faults"][-1][1]["aileron"] == "none"
    texts = [text for _, text in client.messages["/texts"]]
    assert {"UAV 1", "UAV 2", "UAV 3"} >= {text["name"] for text in texts}
    assert any("ARM" in text["message"].upper() for text in texts)


async def _read(address: str, fleet: Up) -> FoxgloveClient:
    async with foxglove_client(address) as client:
        await client.subscribe(*TOPICS, "/texts", "/formation", "/tf")
        for command in ("start", "arm"):
            assert (await asyncio.to_thread(fleet.gcs, command)).returncode == 0
        seen = client.messages
        await client.until(lambda: bool(seen["/uav3/state"]) and seen["/uav3/state"][-1][0] > 2e9)
        await client.until(lambda: all(seen[f"/uav{i}/event"] for i in (1, 2, 3)))
        await client.until(lambda: len(seen["/formation"]) > 3 and len(seen["/tf"]) > 3)
        return client


def _check_states(client: FoxgloveClient, fleet: Up) -> None:
    """States have the values that the vehicles' own recording has at that time."""
    flown = [(t, s) for t, s in client.messages["/uav2/state"] if s["error_yaw"] is not None]
    assert len(flown) > 5
    times = [t for t, _ in flown]
    assert times == sorted(times)
    t, state = flown[-1]
    place = client.messages["/uav2/location"][-1][1]
    assert 0.0 < t / 1e9 < 60.0
    assert 20.0 < state["V"] < 70.0
    assert state["V"] - state["reference_airspeed"] == pytest.approx(
        state["error_airspeed"], abs=0.2
    )
    assert abs(state["held_rudder"]) < 1.0 < state["held_throttle"]  # rad, N
    assert place["latitude"] == pytest.approx(-35.36, abs=0.02)


def _check_events(client: FoxgloveClient) -> None:
    for system in (1, 2, 3):
        counts: dict[str, list[int]] = {}
        for _, event in client.messages[f"/uav{system}/event"]:
            counts.setdefault(event["actuator"], []).append(event["count"])
        assert counts.keys() <= {"aileron", "elevator", "rudder", "throttle"}
        assert all(numbers == sorted(set(numbers)) for numbers in counts.values())


def test_a_client_that_does_not_read_delays_nobody(tmp_path: Path) -> None:
    address = f"127.0.0.1:{free_port()}"
    options = ("--foxglove-at", address, "--lockstep", "--start")

    async def read() -> None:
        async with foxglove_client(address) as slow, foxglove_client(address) as reader:
            await slow.subscribe("/formation", *TOPICS)  # and never receives again
            await reader.subscribe("/uav1/state")
            states = reader.messages["/uav1/state"]
            await reader.until(lambda: bool(states) and states[-1][0] > 100e9)

    with up(tmp_path / "fleet", *options, tree=scenario_tree(faults=[])) as fleet:
        asyncio.run(read())
        assert fleet.gcs_json("status")["vehicles"][0]["armed"]


def test_the_layout_names_channels_that_there_are(tmp_path: Path) -> None:
    from gcs.fleet.foxglove.layout import layout_of

    layout = layout_of([uav.id for uav in load_scenario("paper/scenario1").uavs])
    named = set(re.findall(r'"(/[a-z0-9/]+)', layout))
    assert TOPICS - {f"/uav{i}/location" for i in (1, 2, 3)} | {"/texts", "/formation"} == named
    fields = set(re.findall(r"/uav\d+/state\.(\w+)", layout))
    assert fields == {f"error_{name}" for name in ("airspeed", "roll", "pitch", "yaw")}
    content: dict[str, Any] = json.loads(layout)
    assert content["content"]["type"] == "split"


def test_bad_addresses_are_one_message(tmp_path: Path) -> None:
    out = ("--out", tmp_path / "run", "--free-ports")
    done = run("gcs", "up", "paper/scenario1", "--foxglove-at", "here", *out)
    assert "--foxglove-at: expected host:port" in failed(done, BAD_INPUT)
    import socket

    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        done = run("gcs", "up", "paper/scenario1", "--foxglove-at", address, *out)
    assert "of 127.0.0.1 is in use" in failed(done, BAD_INPUT)
    assert not (tmp_path / "run").exists()
