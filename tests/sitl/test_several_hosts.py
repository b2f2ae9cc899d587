"""A fleet on two hosts, started process by process with the files of ``gcs config``.

The hosts are network namespaces joined by a virtual cable, or where those are not permitted (they
need root and iproute2) two addresses of this machine.
"""

import contextlib
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import yaml
from flying import (
    BIN,
    TIMEOUT_S,
    assert_one_message,
    environment,
    free_links,
    recorded_by,
    run,
    write_scenario,
)

from gcs.fleet.in_process import fly_in_process
from gcs.scenario.model import load_scenario

pytestmark = pytest.mark.sitl

STEPS = 300


class Host(NamedTuple):
    """A host, and what stands before a command that is to run on it."""

    address: str
    prefix: tuple[str, ...] = ()


def ip(*arguments: str) -> None:
    subprocess.run(["ip", *arguments], check=True, capture_output=True, timeout=TIMEOUT_S)


@pytest.fixture
def hosts() -> Iterator[tuple[Host, Host]]:
    """Two hosts that reach each other, and in namespaces nothing else."""
    names = [f"ftc{os.getpid()}{end}" for end in "ab"]
    addresses = ["192.0.2.1", "192.0.2.2"]
    a, b = names
    with contextlib.ExitStack() as stack:
        try:
            for name in names:
                ip("netns", "add", name)
                stack.callback(ip, "netns", "del", name)
            ip("-n", a, "link", "add", "cable", "type", "veth", "peer", "name", "cable", "netns", b)
            for name, address in zip(names, addresses, strict=True):
                ip("-n", name, "address", "add", f"{address}/24", "dev", "cable")
                ip("-n", name, "link", "set", "cable", "up")
                ip("-n", name, "link", "set", "lo", "up")
                ip("netns", "exec", name, "true")
        except (FileNotFoundError, subprocess.CalledProcessError):  # no iproute2, or not permitted
            yield Host("127.0.0.2"), Host("127.0.0.3")
        else:
            first, second = (
                Host(address, ("ip", "netns", "exec", name))
                for name, address in zip(names, addresses, strict=True)
            )
            yield first, second


@contextlib.contextmanager
def started(host: Host, *command: str | Path) -> Iterator[subprocess.Popen[str]]:
    program, *arguments = command
    popen = subprocess.Popen(
        [*host.prefix, BIN / program, *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    with popen:
        try:
            yield popen
        finally:
            popen.kill()


def test_a_fleet_on_two_hosts_flies_as_on_one(hosts: tuple[Host, Host], tmp_path: Path) -> None:
    links = free_links()
    path = write_scenario(tmp_path, duration_s=STEPS / 1000, faults=[], links=links)
    a, b = hosts
    where = {"plant": a, "uav1": a, "uav2": b, "uav3": b, "gcs": b}
    options = [f"--host={name}={host.address}" for name, host in where.items()]
    fleet = tmp_path / "fleet"
    config: list[str | Path] = ["config", path, "--out", fleet, *options]
    if a.address.startswith("10."):
        refused = run("gcs", *config)
        assert refused.returncode == 2
        assert "other machines can reach" in refused.stderr
    assert run("gcs", *config, "--insecure").returncode == 0
    plant = yaml.safe_load((fleet / "plant.yaml").read_text())
    lockstep = {"speed": None, "duration_s": STEPS / 1000}
    (fleet / "plant.yaml").write_text(yaml.safe_dump(plant | lockstep))
    record: dict[str, list[str | Path]] = {name: ["--record", fleet / name] for name in where}

    with contextlib.ExitStack() as stack:
        processes = [
            stack.enter_context(
                started(where["plant"], "sitl-plant", fleet / "plant.yaml", *record["plant"])
            )
        ]
        for name in ("uav1", "uav2", "uav3"):
            popen = started(where[name], "ftc-autopilot", fleet / f"{name}.yaml", *record[name])
            processes.append(stack.enter_context(popen))
        connect = f"udpin:{where['gcs'].address}:{links['gcs_port']}"
        orders: list[list[str | Path]] = [["profile", "upload", path], ["start"], ["arm"]]
        for order in orders:
            station = ["--uav", "1,2,3", "--connect", connect, "--timeout", str(TIMEOUT_S)]
            with started(where["gcs"], "gcs", *order, *station) as command:
                _, problem = command.communicate(timeout=TIMEOUT_S)
                assert command.returncode == 0, problem
        for process in processes:
            _, text = process.communicate(timeout=TIMEOUT_S)
            assert process.returncode == 0, text
            assert "dropped" not in text

    expected = fly_in_process(load_scenario(path))
    assert np.array_equal(recorded_by(fleet / "plant")["states"], expected.states)
    for i in (1, 2, 3):
        signals = recorded_by(fleet / f"uav{i}")["signals"]
        assert signals.tobytes() == expected.signals[:, i - 1].tobytes()


@pytest.mark.parametrize(
    ("option", "expected"),
    [
        ("uav9=10.0.0.1", "plant, uav1, uav2, uav3, gcs"),
        ("plant", "host name after the ="),
        ("gcs=10.0.0.1:7", "host name after the ="),
    ],
)
def test_a_host_that_cannot_be_is_refused(option: str, expected: str, tmp_path: Path) -> None:
    done = run("gcs", "config", "paper/scenario1", "--out", tmp_path / "x", "--host", option)
    assert done.returncode == 2
    assert_one_message(done.stderr)
    assert option in done.stderr
    assert expected in done.stderr
    assert not (tmp_path / "x").exists()
