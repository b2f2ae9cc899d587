"""The autopilot process of one UAV: ``ftc-autopilot CONFIG``.

It registers with the plant by HEARTBEAT, exchanges messages with its neighbours and the ground
stations, and flies until the plant ends the simulation. Exit status: 0 the simulation ended or
a signal stopped it, 1 the plant fell silent, 2 bad input.
"""

import argparse
import sys
from functools import partial
from pathlib import Path

from ftc_autopilot.autopilot import Autopilot, log
from ftc_autopilot.config import AutopilotConfig
from mavlink_defs.config.files import load
from mavlink_defs.config.models import ConfigError
from mavlink_defs.endpoint import (
    EndpointError,
    UdpAddress,
    bind_udp,
    connect_udp,
    exposed,
    is_loopback,
    open_udp,
    parse_address,
)
from mavlink_defs.framing.key_file import KeyFile
from mavlink_defs.framing.signing import SigningError, words_of
from mavlink_defs.runtime.shutdown import on_stop

__all__ = ["main"]


def main(arguments: list[str] | None = None) -> None:
    """Run the autopilot process and exit."""
    parser = argparse.ArgumentParser(
        prog="ftc-autopilot",
        description="Fly one UAV: controller, event trigger, MAVLink services.",
        epilog="`gcs fly` writes such a CONFIG for each UAV of a scenario into its run folder.",
    )
    parser.add_argument("config", type=Path, help="autopilot configuration (YAML)")
    parser.add_argument("--record", type=Path, metavar="FOLDER", help="write all signals as .npy")
    parser.add_argument(
        "--exit-with-parent", type=int, metavar="PID", help="stop when this parent is gone"
    )
    parser.add_argument(
        "--keep",
        type=Path,
        metavar="FILE",
        help="keep the state here, and take it up if it is there",
    )
    parser.add_argument(
        "--crash-at", type=int, metavar="STEP", help="die after this step, as by SIGKILL: for tests"
    )
    options = parser.parse_args(arguments)
    try:
        config = load(options.config, AutopilotConfig)
        key_file = None
        if config.signing_key:
            key_file = KeyFile(config.signing_key, partial(log, config.id))
        address = parse_address(config.formation_bind)
        plant = connect_udp(parse_address(config.plant))
        formation = bind_udp(
            address,
            f"formation link of UAV {config.id}",
            "change `formation_bind`",
        )
        gcs = open_udp(map(parse_address, config.gcs))
    except (ConfigError, EndpointError, SigningError) as problem:
        print(problem, file=sys.stderr)
        sys.exit(2)
    for at in (address, UdpAddress(*gcs.getsockname())):
        if not is_loopback(at):
            log(config.id, exposed(at, bool(config.signing_key)))
    try:
        autopilot = Autopilot(config, plant, formation, gcs, options.record, key_file, options.keep)
    except (EndpointError, SigningError) as problem:
        print(problem, file=sys.stderr)
        sys.exit(2)
    except OSError as problem:
        print(f"cannot write {problem.filename}: {problem.strerror}", file=sys.stderr)
        sys.exit(2)
    if options.crash_at is not None:
        autopilot.crash_at = options.crash_at

    def stop() -> None:
        autopilot.stopping = True

    on_stop(stop, options.exit_with_parent)
    with plant, formation, gcs:
        loss = autopilot.fly()
    loss = autopilot.finish_record(loss)
    if refused := autopilot.refused():
        log(config.id, f"frames dropped: {words_of(refused)}")
    if loss is not None:
        log(config.id, loss)
    sys.exit(0 if loss is None else 1)
