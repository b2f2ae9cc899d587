"""Python's flights over the wire and on all cores, beside an event loop, and its ground station."""

import asyncio
import contextlib
import json
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest
from flying import TIMEOUT_S, run, wait_until, write_scenario
from station import Up, up

from gcs import BadInput, CommandRefused, Flight, NoAnswer, connect, fly, fly_many
from gcs.fleet import local_workers
from gcs.results.flight_mark import FLIGHT, read_mark

pytestmark = pytest.mark.sitl

SHORT = {"duration_s": 1.5}


def same(one: Flight, other: Flight) -> bool:
    """Whether two flights, however they were flown, have the same steps, bit for bit."""
    return bool(
        one.frame().equals(other.frame())
        and one.events.equals(other.events)
        and one.summary.uavs == other.summary.uavs
    )


@pytest.fixture(scope="module")
def in_process() -> Flight:
    return fly("paper/scenario1", SHORT, record="full")


def test_over_udp_a_flight_is_the_same_bit_for_bit(in_process: Flight, tmp_path: Path) -> None:
    run = tmp_path / "run"
    flight = fly("paper/scenario1", SHORT, over_udp=True, record="full", out=run)
    assert flight.summary.mode == "lockstep"
    assert same(flight, in_process)
    assert {"flight.tlog", "processes", "scenario.yaml"} <= {path.name for path in run.iterdir()}


@pytest.mark.parametrize("over_udp", [False, True])
def test_beside_a_running_loop(over_udp: bool, in_process: Flight) -> None:
    """As in a notebook: the loop waits meanwhile; in a thread, it goes on."""

    async def flown() -> list[Flight]:
        first = fly("paper/scenario1", SHORT, over_udp=over_udp, record="full")
        work = asyncio.to_thread(
            fly,
            "paper/scenario1",
            SHORT,
            over_udp=over_udp,
            record="full",
            autopilot_processes=None,
        )
        return [first, await work]

    for flight in asyncio.run(flown()):
        assert same(flight, in_process)
    assert not [thread for thread in threading.enumerate() if thread.name == "flight"]


INTERRUPTED = """
import asyncio, gc, signal, sys, threading
from gcs import fly, fly_many

scenario, how = sys.argv[1:]

async def flown():
    print("begins", flush=True)
    if how == "fly_many":
        fly_many([scenario, scenario], progress=False)
    else:
        fly(scenario, over_udp=how == "over_udp", out="run")

try:
    asyncio.run(flown())
except KeyboardInterrupt:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.collect()  # a task or a socket that is left is an error here
    print([thread.name for thread in threading.enumerate() if thread.name == "flight"])
"""


@pytest.mark.parametrize(
    ("how", "times"), [("over_udp", 1), ("over_udp", 2), ("in_process", 1), ("fly_many", 1)]
)
def test_ctrl_c_in_a_coroutine(tmp_path: Path, how: str, times: int) -> None:
    """The first Ctrl-C in `asyncio.run` only cancels the task, which awaits nothing meanwhile.

    In a process of its own, as the last Ctrl-C may come when the flight is over.
    """
    scenario = write_scenario(tmp_path, duration_s=3600.0, faults=[])
    program = subprocess.Popen(
        [sys.executable, "-W", "error", "-c", INTERRUPTED, str(scenario), how],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert program.stdout is not None
    assert program.stdout.readline() == "begins\n"
    if how != "fly_many":
        wait_until((tmp_path / "run" / FLIGHT).exists, "the flight is marked")
    time.sleep(Random(how + str(times)).uniform(1.0, 4.0))  # any instant will do
    for _ in range(times):
        program.send_signal(signal.SIGINT)
        time.sleep(0.02)
    stdout, stderr = program.communicate(timeout=TIMEOUT_S)
    assert stdout == "[]\n", stderr
    assert "Traceback" not in stderr
    if how != "fly_many":
        mark = read_mark(tmp_path / "run")
        assert mark is not None
        assert mark.ended == "interrupted"


WITHOUT_FILES = """
import asyncio, resource
from gcs.fleet.event_loops import beside_any_loop

async def flown():
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
    beside_any_loop(lambda: asyncio.sleep(0.0))

try:
    asyncio.run(flown())
except OSError as problem:
    print(problem.strerror)
"""


def test_without_room_for_another_event_loop_the_call_ends() -> None:
    command = [sys.executable, "-c", WITHOUT_FILES]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    assert done.stdout == "Too many open files\n", done.stderr


def test_many_flights_come_in_order_on_all_cores(in_process: Flight) -> None:
    masses = [0.9, 0.95, 1.0, 1.05, 1.1]
    changes = [{**SHORT, "uncertainty.mass": mass} for mass in masses]
    scenario = in_process.scenario
    flights = fly_many(
        [*(("paper/scenario1", change) for change in changes), scenario], record="full", jobs=2
    )
    for flight, change in zip(flights, changes, strict=False):
        assert same(flight, fly("paper/scenario1", change, record="full"))
    assert same(flights[-1], in_process)
    (summary,) = (flight.summary for flight in fly_many([scenario], progress=False))
    assert summary.uavs == in_process.summary.uavs
    assert fly_many([]) == []


@pytest.mark.parametrize(
    ("flights", "text"),
    [
        (["paper/scenario1", "paper/scenario0"], "flights[1]: "),
        ([("paper/scenario1", {"trigger.b2": 1})], "flights[0]: changes: trigger.b2: unknown key"),
        ([("paper/scenario1", {"links.impairments": {}})], "links.impairments apply to the wire"),
    ],
)
def test_of_many_flights_the_wrong_one_is_named(flights: Any, text: str) -> None:
    with pytest.raises(BadInput) as refused:
        fly_many(flights)
    assert text in str(refused.value)


SCRIPT = """
from gcs import fly_many

print("begins")
flights = fly_many([("paper/scenario1", {"duration_s": 0.1 * k}) for k in range(1, 5)], jobs=2)
print([flight.summary.duration_s for flight in flights])
"""


def test_a_script_needs_no_guard(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    done = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, timeout=TIMEOUT_S, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "begins\n[0.1, 0.2, 0.3, 0.4]\n"  # once: no worker has run it again
    assert "Traceback" not in done.stderr


def test_what_a_worker_meets_is_raised() -> None:
    with contextlib.closing(local_workers.LocalWorkers[float, float](1, _inverse)) as workers:
        workers.submit(4.0)
        assert workers.wait() == (4.0, 0.25)
        workers.submit(0.0)
        with pytest.raises(ZeroDivisionError):
            workers.wait()


def _inverse(value: float, _worker: str) -> float:
    return 1.0 / value


def test_a_campaign_returns_its_table(tmp_path: Path) -> None:
    from gcs import campaign

    tree = {
        "name": "mine",
        "scenario": "paper/scenario1",
        "draws": 4,
        "factors": {"uncertainty.mass": {"draw": {"kind": "uniform", "low": 0.9, "high": 1.1}}},
        "variants": {"base": {"duration_s": 0.5}},
    }
    results = campaign(tree, out=tmp_path / "out", jobs=2, progress=False)
    assert results.num_rows == 4
    assert set(results.column("outcome").to_pylist()) == {"completed"}
    for row in results.to_pylist():
        drawn = {"uncertainty.mass": row["factor.uncertainty.mass"], "duration_s": 0.5}
        flight = fly("paper/scenario1", drawn, record="none")
        assert row["uav3.iae_roll"] == flight.figures["iae_roll"][3]
    assert (tmp_path / "out" / "report.html").exists()
    (tmp_path / "mine.yaml").write_text(json.dumps(tree))  # JSON is YAML
    again = campaign(tmp_path / "mine.yaml", out=tmp_path / "of_file", jobs=1, progress=False)
    same_names = [name for name in results.column_names if name != "wall_s"]
    assert again.select(same_names).to_pandas().equals(results.select(same_names).to_pandas())
    with pytest.raises(BadInput, match="drows: unknown key"):
        campaign({**tree, "drows": 3}, out=tmp_path / "wrong")
    assert not (tmp_path / "wrong").exists()


# the ground station


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    with up(tmp_path_factory.mktemp("fleet"), "--lockstep") as running:
        yield running


def test_a_station_commands_a_fleet(fleet: Up) -> None:
    async def operate() -> None:
        async with connect(fleet.hub, timeout_s=TIMEOUT_S) as station:
            assert sorted(station) == [1, 2, 3]
            mission = await station[1].download_mission()
            profile = await station[1].download_profile()
            assert profile
            await station[1].upload_profile(profile)
            assert await station[1].download_profile() == profile
            assert len(await station[1].download_mission()) == len(mission) > 1
            with pytest.raises(BadInput, match="no such file"):
                await station[1].upload_profile("nowhere.yaml")
            events, attitudes = station.notifications(), station[3].messages("ATTITUDE")
            everything = station.messages()
            await station.start()
            heard: list[Any] = [await anext(attitudes) for _ in range(5)]
            assert {(one.get_type(), one.get_srcSystem()) for one in heard} == {("ATTITUDE", 3)}
            times = [one.time_boot_ms for one in heard]
            assert times == sorted(times)
            assert {(await anext(everything)).get_srcSystem() for _ in range(300)} == {1, 2, 3}
            assert all(uav.state.armed for uav in station.values())

            await station[3].set_fault("rudder", effectiveness=0.5, end_s=1e6)
            (fault,) = [f for f in await station[3].faults() if f.end_s == 1e6]
            assert fault.effectiveness == 0.5
            async for entry in events:
                if entry.kind == "faults" and entry.system == 3:
                    break
            await station[3].clear_faults("rudder")
            assert not [f for f in await station[3].faults() if f.end_s == 1e6]

            before = (await station[2].get_param("TRIG_B2_DEG")).value
            assert (await station[2].set_param("TRIG_B2_DEG", 2.0 * before)).value == 2.0 * before
            await station[2].set_param("TRIG_B2_DEG", before)
            await station[2].set_mode("LOITER")
            with pytest.raises(CommandRefused):
                await station[2].disarm()
            for wrong in ({"effectiveness": 2.0}, {"bias_n": 1.0}, {"colour": 1.0}):
                with pytest.raises(BadInput):
                    await station[3].set_fault("rudder", **wrong)
            with pytest.raises(BadInput, match="actuator: expected aileron"):
                await station[3].clear_faults("flaps")
            rest = station[1].messages("ATTITUDE")
        async for _ in rest:  # what had come; the subscription ends with the connection
            pass

    asyncio.run(operate())


def test_a_station_that_hears_nobody_says_so(fleet: Up) -> None:
    async def listen(address: str, **options: Any) -> None:
        async with connect(address, **options):
            raise AssertionError("nobody is there")

    with pytest.raises(NoAnswer, match="UAV 9 not heard"):
        asyncio.run(listen(fleet.hub, uavs=[9], timeout_s=0.5))
    with pytest.raises(NoAnswer, match="nobody listens at"):
        asyncio.run(listen("udpout:127.0.0.1:9", timeout_s=0.5))
    with pytest.raises(BadInput, match="--connect"):
        asyncio.run(listen("tcp:nowhere"))


def test_a_flight_of_the_command_is_opened(in_process: Flight, tmp_path: Path) -> None:
    from gcs import open_run

    folder = tmp_path / "run"
    options = ("--set", "duration_s=1.5", "--record", "full", "--free-ports", "--out", folder)
    done = run("gcs", "fly", "paper/scenario1", *options)
    assert done.returncode == 0, done.stderr
    flight = open_run(folder)
    assert same(flight, in_process)
    assert flight.scenario.name == in_process.scenario.name
    assert str(flight).split("\n")[0].strip() == "Transmissions in 1500 control periods"
