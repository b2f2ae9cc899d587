"""The lockstep traffic of a fleet with nothing behind it: what sockets and scheduler allow.

One process plays the plant and one each autopilot, with the socket calls and the ways to wait of
the product. Every step has the datagrams of a flight, of the same sizes: a state to each autopilot,
one from each to its neighbours (a star around the first), an actuator message from those with an
event, FTC_STEP_DONE from each. They are not packed, checked or understood, and there is no physics,
control or telemetry.

``python -m benchmarks.bare_loop --plant-us 9 --autopilot-us 6`` prints the time of a step with and
without work of such a length in each process, which is that of a flight's compiled code.
"""

import argparse
import os
import signal
import socket
import statistics
import time

import numpy as np

from mavlink_defs.endpoint import UdpAddress, bind_udp, connect_udp, set_receive_timeout, sockaddr
from mavlink_defs.framing import codec
from mavlink_defs.framing.header import CRC_SIZE, HEADER_SIZE
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.native import (
    ADDRESS_SIZE,
    monotonic_s,
    receive_from_soon,
    receive_soon,
    send,
    send_to,
)

__all__ = ["bare_us_per_step"]

_AROUND = HEADER_SIZE + CRC_SIZE
_STATE = codec.SIM_STATE_SIZE - codec.SIM_STATE["wind"].itemsize + _AROUND  # in calm air
_ACTUATORS = codec.ACTUATORS_SIZE + _AROUND
_NEIGHBOUR = codec.NEIGHBOUR_SIZE + _AROUND
_DONE = 2 + _AROUND  # of a step below 65536, without the zeros at its end
_TIMEOUT_S = 5.0
_ANY = UdpAddress("127.0.0.1", 0)


def bare_us_per_step(
    uavs: int, steps: int, events: float, plant_s: float = 0.0, autopilot_s: float = 0.0
) -> float:
    """Return the time of a step [µs], the mean of `steps`.

    Args:
        uavs: Number of autopilots.
        steps: Number of steps.
        events: Actuator messages of each autopilot and step, 0 to 1.
        plant_s: Work of the plant in each step [s].
        autopilot_s: Work of each autopilot in each step [s].

    Raises:
        RuntimeError: A datagram was lost.
    """
    plant = bind_udp(_ANY, "plant of the bare loop")
    formation = [bind_udp(_ANY, "autopilot of the bare loop") for _ in range(uavs)]
    autopilots = [connect_udp(UdpAddress(*plant.getsockname())) for _ in range(uavs)]
    sockets = [plant, *formation, *autopilots]
    for sock in sockets:
        set_receive_timeout(sock, _TIMEOUT_S)
    ports, back = _addresses(formation), _addresses(autopilots)
    plant_loop(plant.fileno(), back[:0], 1, 0.0)  # compile both before the fork
    autopilot_loop(plant.fileno(), plant.fileno(), ports[:0], 0, 0.0, 0.0)
    children = []
    try:
        for i in range(uavs):
            neighbours = ports[1:] if i == 0 else ports[:1]
            if (pid := os.fork()) == 0:
                fds = autopilots[i].fileno(), formation[i].fileno()
                autopilot_loop(*fds, neighbours, steps, events, autopilot_s)
                os._exit(0)
            children.append(pid)
        begin = time.perf_counter()
        made = plant_loop(plant.fileno(), back, steps, plant_s)
        end = time.perf_counter()
    finally:
        for pid in children:
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
        for sock in sockets:
            sock.close()
    if made < steps:
        raise RuntimeError(f"the bare loop lost a datagram in step {made} of {steps}")
    return (end - begin) / steps * 1e6


def _addresses(sockets: list[socket.socket]) -> np.ndarray:
    addresses = [sockaddr(UdpAddress(*sock.getsockname())) for sock in sockets]
    return np.array(addresses, np.uint8).reshape(len(sockets), ADDRESS_SIZE)


@compiled
def work(length_s: float) -> None:
    """Keep the processor for a time [s]."""
    end_s = monotonic_s() + length_s
    while monotonic_s() < end_s:
        pass


@compiled
def plant_loop(fd: int, autopilots: np.ndarray, steps: int, work_s: float) -> int:
    """Return the number of steps made."""
    datagram, sender = np.zeros(codec.BUFFER_SIZE, np.uint8), np.zeros(ADDRESS_SIZE, np.uint8)
    for step in range(steps):
        if work_s > 0.0:
            work(work_s)
        for i in range(len(autopilots)):
            send_to(fd, datagram, _STATE, autopilots[i])
        done = 0
        while done < len(autopilots):
            length = receive_from_soon(fd, datagram, sender)
            if length < 0:
                return step
            done += length == _DONE
    return steps


@compiled
def autopilot_loop(
    fd: int, formation_fd: int, neighbours: np.ndarray, steps: int, events: float, work_s: float
) -> None:
    datagram, sender = np.zeros(codec.BUFFER_SIZE, np.uint8), np.zeros(ADDRESS_SIZE, np.uint8)
    for step in range(steps):
        if receive_soon(fd, datagram) < 0:
            return
        if step > 0:
            for _ in range(len(neighbours)):
                receive_from_soon(formation_fd, datagram, sender)
        if work_s > 0.0:
            work(work_s)
        for d in range(len(neighbours)):
            send_to(formation_fd, datagram, _NEIGHBOUR, neighbours[d])
        if int((step + 1) * events) > int(step * events):
            send(fd, datagram, _ACTUATORS)
        send(fd, datagram, _DONE)


def main() -> None:
    """Print the time of a step, with and without work, in turn."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bare_loop", description=__doc__)
    parser.add_argument("--uavs", type=int, default=3, help="number of autopilots")
    parser.add_argument("--steps", type=int, default=30_000, help="steps of a round")
    parser.add_argument(
        "--events", type=float, default=0.4, help="actuator messages of a UAV a step"
    )
    parser.add_argument("--rounds", type=int, default=5, help="rounds of each")
    parser.add_argument("--plant-us", type=float, default=9.0, help="work of the plant [µs]")
    parser.add_argument("--autopilot-us", type=float, default=6.0, help="of each autopilot [µs]")
    options = parser.parse_args()
    works = (0.0, 0.0), (options.plant_us * 1e-6, options.autopilot_us * 1e-6)
    times_us: list[list[float]] = [[], []]
    for _ in range(options.rounds):
        for times, (plant_s, autopilot_s) in zip(times_us, works, strict=True):
            size = options.uavs, options.steps, options.events
            times.append(bare_us_per_step(*size, plant_s, autopilot_s))
    bare_us, with_work_us = map(statistics.median, times_us)
    print(
        f"{bare_us:.1f} µs a step; with work {with_work_us:.1f} µs, "
        f"{bare_us / with_work_us:.2f} of the speed"
    )


if __name__ == "__main__":
    main()
