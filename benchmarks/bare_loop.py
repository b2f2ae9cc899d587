"""The lockstep traffic of a fleet with nothing behind it: what sockets and scheduler allow.

One process plays the plant and one each autopilot, unless they share processes as with
`--autopilot-processes`, with the socket calls and the ways to wait of the product. Every step has
the datagrams of a flight, of the same sizes: a state to each autopilot, one from each to its
neighbours (a star around the first), an actuator message from those with an event, FTC_STEP_DONE
from each. They are not packed, checked or understood, and there is no physics, control or
telemetry.

``python -m benchmarks.bare_loop --plant-us 9 --autopilot-us 6`` prints the time of a step with and
without as much work in each process as a flight's compiled code does.
"""

import argparse
import os
import signal
import socket
import statistics
import time

import numpy as np

from mavlink_defs.endpoint import UdpAddress, bind_udp, connect_udp, set_receive_timeout
from mavlink_defs.framing import codec
from mavlink_defs.framing.header import CRC_SIZE, HEADER_SIZE
from mavlink_defs.runtime.jit import compiled
from mavlink_defs.runtime.native import (
    ADDRESS_SIZE,
    POLLED,
    READABLE,
    SPIN_S,
    let_others_run,
    monotonic_s,
    receive_from_soon,
    receive_now,
    send,
    send_to,
    wait_for_any,
)
from mavlink_defs.runtime.sockaddr import sockaddr

_AROUND = HEADER_SIZE + CRC_SIZE
_STATE = codec.SIM_STATE_SIZE - codec.SIM_STATE["wind"].itemsize + _AROUND  # in calm air
_ACTUATORS = codec.ACTUATORS_SIZE + _AROUND
_NEIGHBOUR = codec.NEIGHBOUR_SIZE + _AROUND
_DONE = 2 + _AROUND  # of a step below 65536, without the zeros at its end
_TIMEOUT_S = 5.0
_ANY = UdpAddress("127.0.0.1", 0)


def bare_us_per_step(
    uavs: int,
    steps: int,
    events: float,
    plant_s: float = 0.0,
    autopilot_s: float = 0.0,
    processes: int | None = None,
) -> float:
    """Return the time of a step [µs], the mean of `steps`.

    Args:
        uavs: Number of autopilots.
        steps: Number of steps.
        events: Actuator messages of each autopilot and step, 0 to 1.
        plant_s: Work of the plant in each step [s].
        autopilot_s: Work of each autopilot in each step [s].
        processes: How many the autopilots share; None: each has its own.

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
    fds = np.array([sock.fileno() for sock in autopilots])
    formation_fds = np.array([sock.fileno() for sock in formation])
    neighbours = np.zeros((uavs, max(uavs - 1, 1), ADDRESS_SIZE), np.uint8)
    neighbours[0, : uavs - 1], neighbours[1:, 0] = ports[1:], ports[0]
    counts = np.minimum(np.arange(uavs), 1)  # of neighbours
    counts[0] = uavs - 1
    plant_loop(plant.fileno(), back[:0], 1, 0.0)  # compile both before the fork
    links = fds, formation_fds, neighbours, counts
    autopilots_loop(*links, 0, 0.0, 0.0)
    children = []
    try:
        for k in range(processes or uavs):
            own = np.arange(k, uavs, processes or uavs)
            if (pid := os.fork()) == 0:
                share = fds[own], formation_fds[own], neighbours[own], counts[own]
                autopilots_loop(*share, steps, events, autopilot_s)
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
def autopilots_loop(
    fds: np.ndarray,
    formation_fds: np.ndarray,
    neighbours: np.ndarray,
    counts: np.ndarray,
    steps: int,
    events: float,
    work_s: float,
) -> None:
    datagram, sender = np.zeros(codec.BUFFER_SIZE, np.uint8), np.zeros(ADDRESS_SIZE, np.uint8)
    polled, made = np.zeros(len(fds), POLLED), np.zeros(len(fds), np.int64)
    for i in range(len(fds)):
        polled[i]["fd"], polled[i]["events"] = fds[i], READABLE
    spin_until_s = monotonic_s() + SPIN_S
    while made.min() < steps:
        heard = False
        for i in range(len(fds)):
            fd, formation_fd = fds[i], formation_fds[i]
            if receive_now(fd, datagram) < 0:
                continue
            heard, step = True, made[i]
            made[i] += 1
            if step > 0:
                for _ in range(counts[i]):
                    receive_from_soon(formation_fd, datagram, sender)
            if work_s > 0.0:
                work(work_s)
            for d in range(counts[i]):
                send_to(formation_fd, datagram, _NEIGHBOUR, neighbours[i, d])
            if int((step + 1) * events) > int(step * events):
                send(fd, datagram, _ACTUATORS)
            send(fd, datagram, _DONE)
        now_s = monotonic_s()
        if heard:
            spin_until_s = now_s + SPIN_S
        elif now_s < spin_until_s:
            let_others_run()
        else:
            wait_for_any(polled, _TIMEOUT_S)


def main() -> None:
    """Print the time of a step, with and without work, in turn."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bare_loop", description=__doc__)
    parser.add_argument("--uavs", type=int, default=3, help="number of autopilots")
    parser.add_argument("--steps", type=int, default=30_000, help="steps of a round")
    parser.add_argument(
        "--events", type=float, default=0.4, help="actuator messages of a UAV a step"
    )
    parser.add_argument(
        "--autopilot-processes", type=int, help="processes that the autopilots share"
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
            processes = options.autopilot_processes
            times.append(bare_us_per_step(*size, plant_s, autopilot_s, processes))
    bare_us, with_work_us = map(statistics.median, times_us)
    print(
        f"{bare_us:.1f} µs a step; with work {with_work_us:.1f} µs, "
        f"{bare_us / with_work_us:.2f} of the speed"
    )


if __name__ == "__main__":
    main()
