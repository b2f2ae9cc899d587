"""All that the autopilots of a process are in flight.

One record for each, and beside it a few arrays of what has no fixed length. Compiled code takes
the record of one autopilot; its buffers and counters, its links, sensors, estimator and controller
are parts of it.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from ftc_autopilot.config import AutopilotConfig
from ftc_autopilot.control.controllers import UAV, Controllers, new_controllers, unbound_controllers
from ftc_autopilot.hot.acknowledgement import NONE
from ftc_autopilot.hot.checkpoint import VEHICLE, Checkpoint, no_checkpoint
from ftc_autopilot.hot.formation_link import (
    FORMATION_STATE,
    MAX_SPEED,
    forget_neighbours,
    join_listeners,
    join_neighbours,
)
from ftc_autopilot.hot.link import LINK_STATE, RECORD
from ftc_autopilot.hot.navigation import ESTIMATED, NAVIGATION, new_navigation
from ftc_autopilot.hot.state_age import forget_age
from mavlink_defs.framing.codec import (
    BUFFER,
    DROPS_SIZE,
    HIL_GPS,
    HIL_SENSOR,
    NEIGHBOUR,
    SIM_STATE,
    SIM_STEP,
    STEP_DONE,
)
from mavlink_defs.framing.hot_signing import SIGNER, LinkSigner, load_link_signer
from mavlink_defs.framing.key_file import KeyFile
from mavlink_defs.framing.signing import FORMATION_LINK, PLANT_LINK
from mavlink_defs.runtime.native import ADDRESS_SIZE

_EDGE_FADE_S = 0.5
"""Simulated time in which a dropped neighbour's weight goes to 0, and back [s]."""

AUTOPILOT = np.dtype(
    [
        ("system", "i8"),
        ("degree", "i8"),  # number of its neighbours
        ("drops", "i8", (4, DROPS_SIZE)),  # datagrams dropped, by link and negated `DropReason`
        ("signers", SIGNER, (2,)),  # of the simulator link and of the formation link
        # datagrams: what is to be sent; received from the plant; from a neighbour, and its address
        ("sent", BUFFER),
        ("received", BUFFER),
        ("heard", BUFFER),
        ("sender", "u1", (ADDRESS_SIZE,)),
        # payloads as they were received
        ("sim_state", SIM_STATE),
        ("sim_step", SIM_STEP),
        ("sensor", HIL_SENSOR),
        ("gps", HIL_GPS),
        ("neighbour", NEIGHBOUR),
        ("step_done", STEP_DONE),  # what the plant hears
        ("link", LINK_STATE),
        ("formation", FORMATION_STATE),
        ("measured", SIM_STATE),  # the last state, received or estimated
        ("navigation", NAVIGATION),
        ("vehicle", VEHICLE),
        ("uav", UAV),
    ]
)
"""One autopilot."""


class Autopilots(NamedTuple):
    """The n autopilots of a process, as the compiled loop has them."""

    own: np.ndarray  # (n,), dtype AUTOPILOT
    edges: np.ndarray  # (n, degree), dtype EDGE; of each UAV the first `degree` are in use
    paths: np.ndarray  # (n,), dtype PATH
    histories: np.ndarray  # (n, imus, entries, TRAVEL), the estimators' memory
    record: np.ndarray  # (n, rows), dtype RECORD; no rows: nothing is recorded. Python empties it
    estimates: np.ndarray  # (n, rows, ESTIMATED): the state by which each step was flown
    shared: np.ndarray  # (1,), of `LinkSigner`, shared by all links
    newest: np.ndarray  # (n, 2, streams), of `LinkSigner`, for each link
    checkpoint: Checkpoint  # of a single autopilot

    def of(self, i: int) -> Self:
        """Return one of them, sharing its memory."""
        one = slice(i, i + 1)
        return self._replace(
            own=self.own[one],
            edges=self.edges[one, : self.own[i]["degree"]],
            paths=self.paths[one],
            histories=self.histories[one],
            record=self.record[one],
            estimates=self.estimates[one],
            newest=self.newest[one],
        )

    @property
    def controllers(self) -> Controllers:
        """Their controllers."""
        return Controllers(self.own["uav"], self.edges, self.paths)

    def signer(self, i: int, link: int) -> LinkSigner:
        """Return the signer of a link: PLANT_SIGNER or FORMATION_SIGNER."""
        return LinkSigner(self.own[i]["signers"][link], self.shared, self.newest[i, link])


PLANT_SIGNER, FORMATION_SIGNER = range(2)
"""Index of a link in `AUTOPILOT.signers`."""


def new_autopilots(
    configs: Sequence[AutopilotConfig],
    record_rows: int = 0,
    key_file: KeyFile | None = None,
    *,
    binds: bool = True,
) -> Autopilots:
    """Return autopilots that have received nothing.

    Args:
        configs: Of each; at least one.
        record_rows: Steps whose record there is room for; 0 to record nothing.
        key_file: Signs their links; None: they are not signed.
        binds: Whether plug-ins have functions; else only their parameters are read.

    Raises:
        EndpointError: The address of a neighbour cannot be used.
        PluginError: A plug-in cannot be used.
        SigningError: The time of the last signature cannot be kept.
    """
    n, own = len(configs), np.zeros(len(configs), AUTOPILOT)
    uavs, edges, paths = new_controllers(configs) if binds else unbound_controllers(configs)
    own["uav"] = uavs
    navigations = [new_navigation(config) for config in configs]
    signers = [load_link_signer(key_file, link) for link in (PLANT_LINK, FORMATION_LINK)]
    newest = np.zeros((n, 2, len(signers[0].newest)), np.int64)
    for row, row_edges, config, navigation in zip(own, edges, configs, navigations, strict=True):
        row["system"], row["degree"] = config.id, len(config.neighbours)
        row["navigation"] = navigation.state[0]
        row["signers"] = [signer.state for signer in signers]
        link, formation, step_us = row["link"], row["formation"], config.step_us
        link["run"], link["step_us"] = NONE, step_us
        formation["timeout_steps"] = round(config.neighbour_timeout_s * 1e6 / step_us)
        formation["fade_steps"] = max(round(_EDGE_FADE_S * 1e6 / step_us), 1)
        formation["most_steps_per_s"] = MAX_SPEED * 1e6 / step_us
        join_listeners(formation, config.listeners)
        join_neighbours(row_edges[: len(config.neighbours)], config.neighbours)
    estimated = any(own["navigation"]["count"] > 0)
    autopilots = Autopilots(
        own=own,
        edges=edges,
        paths=paths,
        histories=np.stack([navigation.history for navigation in navigations]),
        record=np.zeros((n, record_rows), RECORD),
        estimates=np.zeros((n, record_rows if estimated else 0, ESTIMATED)),
        shared=signers[0].shared,
        newest=newest,
        checkpoint=no_checkpoint(),
    )
    reset_links(autopilots)
    return autopilots


def reset_links(autopilots: Autopilots) -> None:
    """Forget the flight: steps, unacknowledged events, neighbour states, the record.

    Frames and drops are counted on, and the last state stays.
    """
    state = autopilots.own["link"]
    for name in ("step", "pending_usec", "applied_usec", "delay"):
        state[name] = NONE
    for name in ("pending_step", "repeated", "deviation", "recorded", "gap_usec", "due"):
        state[name] = 0
    forget_age(state)
    autopilots.own["formation"]["edge_changes"] = 0
    forget_neighbours(autopilots.edges)
