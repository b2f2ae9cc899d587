"""The autopilot process of one UAV, or of several: ``ftc-autopilot CONFIG...``.

It registers with the plant by HEARTBEAT, exchanges messages with its neighbours and the ground
stations, and flies until the plant ends the simulation. Exit status: 0 the simulation ended or
a signal stopped it, 1 the plant fell silent, 2 bad input, 3 a plug-in failed.
"""

import socket
import sys
from argparse import Namespace
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import NamedTuple

from ftc_autopilot.autopilot import Autopilot, log
from ftc_autopilot.config import PLUGIN_FAILED, AutopilotConfig
from ftc_autopilot.hot.loop import new_loops, run
from ftc_autopilot.hot.recorder import RECORD_ROWS
from ftc_autopilot.hot.restart import identity_of, with_checkpoint
from ftc_autopilot.hot.state import Autopilots, new_autopilots
from ftc_autopilot.kinds import FtcAutopilot
from mavlink_defs import endpoint
from mavlink_defs.config.files import load
from mavlink_defs.config.models import ConfigError
from mavlink_defs.config.problems import Problem
from mavlink_defs.framing.hot_link import ReturnReason
from mavlink_defs.framing.key_file import KeyFile
from mavlink_defs.framing.signing import SigningError, counts_text
from mavlink_defs.runtime.arguments import ArgumentParser
from mavlink_defs.runtime.foreign import PluginError
from mavlink_defs.runtime.shutdown import on_stop
from mavlink_defs.visible import log_line


class Together:
    """One autopilot, or in lockstep several."""

    def __init__(self, autopilots: Sequence[Autopilot], state: Autopilots) -> None:
        """Take autopilots that have booted, at least one, and their state."""
        self._autopilots, self._state = autopilots, state
        self.stopping = False

    def fly(self) -> None:
        """Serve all links until the simulation is over, or `stopping` is set."""
        flying = list(self._autopilots)
        while flying and not self.stopping:
            self._fly_until_one_ends(flying)
            flying = [autopilot for autopilot in flying if not autopilot.is_over]
        for autopilot in flying:
            autopilot.stop()

    def _fly_until_one_ends(self, flying: Sequence[Autopilot]) -> None:
        rows = [self._autopilots.index(one) for one in flying]
        loops = new_loops(self._state, [one.sockets for one in flying], rows)
        until_s, until_step = loops.state["until_s"], loops.state["until_step"]
        asking = list(enumerate(flying))
        while not self.stopping:
            for i, autopilot in asking:
                until_s[i], until_step[i] = autopilot.until_s(), autopilot.until_step()
            run(loops)
            outcomes = loops.state["outcome"].tolist()
            asking = [(i, flying[i]) for i, outcome in enumerate(outcomes) if outcome]
            for i, autopilot in asking:
                autopilot.serve(ReturnReason(outcomes[i]))
            if any(autopilot.is_over for _, autopilot in asking):
                return


def _options(arguments: list[str] | None) -> Namespace:
    """Return the options of a command line, with a folder or None in `record` for each CONFIG."""
    parser = ArgumentParser(
        prog="ftc-autopilot",
        description="Fly one UAV: controller, event trigger, MAVLink services. In lockstep a "
        "process may fly several, each with the sockets of its CONFIG.",
        epilog="`gcs fly` writes such a CONFIG for each UAV of a scenario into its run folder.",
    )
    parser.add_argument(
        "configs", type=Path, nargs="+", metavar="CONFIG", help="autopilot configuration (YAML)"
    )
    parser.add_argument(
        "--record",
        type=Path,
        action="append",
        metavar="FOLDER",
        help="write all signals as .npy; with several CONFIGs once for each",
    )
    parser.add_argument(
        "--record-optional",
        action="store_true",
        help="fly on if FOLDER cannot be written, and without control if a plug-in fails",
    )
    parser.add_argument(
        "--exit-with-parent", type=int, metavar="PID", help="stop when this parent process is gone"
    )
    parser.add_argument(
        "--checkpoint",
        type=Path,
        metavar="FILE",
        help="save the state in FILE, and resume from it if it is there; with one CONFIG only",
    )
    parser.add_argument(
        "--crash-at", type=int, metavar="STEP", help="for tests: end after this step, as by SIGKILL"
    )
    options = parser.parse_args(arguments)
    number = len(options.configs)
    if number > 1 and options.checkpoint is not None:
        parser.error("--checkpoint is for one UAV: start a process for each CONFIG")
    options.record = options.record or [None] * number
    if len(options.record) != number:
        parser.error(f"{len(options.record)} --record for {number} CONFIGs: give one for each")
    return options


class PreparedAutopilots(NamedTuple):
    """What a process has before it opens sockets; one that is forked may begin with it."""

    options: Namespace
    configs: list[AutopilotConfig]
    key_file: KeyFile | None
    state: Autopilots | None  # None for a bridge
    identity: str | None  # of a checkpoint


def main(arguments: list[str] | None = None, prepared: PreparedAutopilots | None = None) -> None:
    """Run the autopilot process and exit; `prepared` of the same arguments, if it is there."""
    with ExitStack() as sockets:
        try:
            prepared = prepared or prepare(arguments)
            options = prepared.options
            if prepared.state is None:
                sys.exit(_fly_foreign(prepared.configs[0], options))
            autopilots, state = _boot(prepared, prepared.state, sockets)
        except (ConfigError, endpoint.EndpointError, PluginError, SigningError) as problem:
            log_line(problem)
            sys.exit(2)
        except OSError as problem:
            log_line(f"cannot write {problem.filename}: {problem.strerror}")
            sys.exit(2)
        for autopilot in autopilots:
            autopilot.record_optional = options.record_optional
        if options.crash_at is not None:
            autopilots[0].crash_at = options.crash_at
        together = Together(autopilots, state)

        def stop() -> None:
            together.stopping = True

        on_stop(stop, options.exit_with_parent)
        together.fly()
    for autopilot in autopilots:
        autopilot.finish_record()
        if refused := autopilot.refused():
            log(autopilot.system, f"frames dropped: {counts_text(refused)}")
        if autopilot.loss is not None and autopilot.failure is None:
            log(autopilot.system, autopilot.loss)
    if any(autopilot.failure is not None for autopilot in autopilots):
        sys.exit(PLUGIN_FAILED)
    sys.exit(0 if all(autopilot.loss is None for autopilot in autopilots) else 1)


def prepare(arguments: list[str] | None = None) -> PreparedAutopilots:
    """Read the configurations, and make the state of the autopilots.

    Raises:
        ConfigError, EndpointError, PluginError, SigningError: A configuration cannot be used.
    """
    options = _options(arguments)
    configs = [load(file, AutopilotConfig) for file in options.configs]
    for config in configs:
        if not isinstance(config.autopilot, FtcAutopilot):
            return PreparedAutopilots(options, [config], None, None, None)
    first, key_file = configs[0], None
    for file, config in zip(options.configs, configs, strict=True):
        if config.signing_key != first.signing_key:
            problem = Problem(
                ("signing_key",),
                f"expected the key of {options.configs[0]}, whose process it shares",
            )
            raise ConfigError(file, [problem])
    if first.signing_key:
        key_file = KeyFile(first.signing_key, partial(log, first.id))
    rows = 0 if options.record[0] is None else RECORD_ROWS
    identity = identity_of(first) if options.checkpoint else None
    return PreparedAutopilots(
        options, configs, key_file, new_autopilots(configs, rows, key_file), identity
    )


def _fly_foreign(config: AutopilotConfig, options: Namespace) -> int:
    """Fly the bridge of a foreign autopilot; return the exit status."""
    from ftc_autopilot.foreign.base import ForeignInputError
    from ftc_autopilot.foreign.bridge import Bridge

    if len(options.configs) > 1:
        log_line(f"UAV {config.id} has a foreign autopilot: its bridge is a process of its own")
        return 2
    with ExitStack() as sockets:
        try:
            (record,) = options.record
            bridge = Bridge(config, record, options.record_optional, sockets, options.checkpoint)

            def stop() -> None:
                bridge.stopping = True

            on_stop(stop, options.exit_with_parent)
            bridge.fly()
        except (endpoint.EndpointError, SigningError, ForeignInputError) as problem:
            log_line(problem)
            return 2
        except OSError as problem:
            log_line(f"cannot write {problem.filename}: {problem.strerror}")
            return 2
        return bridge.finish()


def _boot(
    prepared: PreparedAutopilots, state: Autopilots, sockets: ExitStack
) -> tuple[list[Autopilot], Autopilots]:
    """Return autopilots, and their state.

    The sockets are closed with `sockets`.

    Raises:
        EndpointError, PluginError: A configuration cannot be used.
        OSError: A file cannot be made; it is named.
    """
    options, configs, key_file, _, identity = prepared
    own_sockets = [_open_sockets(config, sockets) for config in configs]
    resumes, mission = False, None
    if options.checkpoint is not None:
        state, resumes = with_checkpoint(state, configs[0], options.checkpoint, identity)
        mission = options.checkpoint.with_suffix(".mission")
    autopilots = [
        Autopilot(config, state.of(i), *own_sockets[i], record, key_file, mission, resumes)
        for i, (config, record) in enumerate(zip(configs, options.record, strict=True))
    ]
    return autopilots, state


def _open_sockets(
    config: AutopilotConfig, sockets: ExitStack
) -> tuple[socket.socket, socket.socket, socket.socket]:
    """Return sockets: connected to the plant, on the formation port, of ground stations."""
    address = endpoint.parse_address(config.formation_bind)
    plant = sockets.enter_context(endpoint.connect_udp(endpoint.parse_address(config.plant)))
    formation = sockets.enter_context(
        endpoint.bind_udp(address, f"formation link of UAV {config.id}", "change `formation_bind`")
    )
    gcs = sockets.enter_context(endpoint.open_udp(map(endpoint.parse_address, config.gcs)))
    for at in (address, endpoint.UdpAddress(*gcs.getsockname())):
        if not endpoint.is_loopback(at):
            log(config.id, endpoint.exposed(at, bool(config.signing_key)))
    return plant, formation, gcs
