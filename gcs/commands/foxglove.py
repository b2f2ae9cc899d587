"""The WebSocket of ``gcs up --foxglove``. Needs the extra `foxglove`.

The SDK serves from threads of its own; it drops the oldest messages of a client that does not read
them, so that none waits for it. Clients can only read: nothing else is offered to them.
"""

import asyncio
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import foxglove
from foxglove.channels import FrameTransformsChannel, SceneUpdateChannel

from gcs.console.errors import BadInput
from gcs.fleet.foxglove.layout import layout_of
from gcs.fleet.foxglove.live_channels import LiveChannels, all_channels
from gcs.fleet.foxglove.scene import FormationScene
from gcs.fleet.observer import Observer
from gcs.results.channels import ChannelKind, encoded, nanoseconds
from gcs.scenario.model import Scenario
from gcs.station.client import Client
from gcs.station.connection import own_identity
from mavlink_defs.config.output_files import complete_file
from mavlink_defs.endpoint import Connection, UdpAddress

LAYOUT = "foxglove.json"
"""Name of the layout in the run folder."""

T = TypeVar("T")

_SCENE_S = 0.1
"""Period of drawing the formation, of wall-clock time [s]."""


class FoxgloveServer:
    """The channels of a fleet, served to Foxglove.

    Attributes:
        url: Where clients connect.
        lines: How to open it, for the user.
    """

    def __init__(self, scenario: Scenario, folder: Path, address: UdpAddress) -> None:
        """Start to serve; until `feed`, without messages.

        Args:
            scenario: What is flown.
            folder: Run folder, exists; gets the layout.
            address: Where clients connect.

        Raises:
            BadInput: The address cannot be used.
            OSError: The layout cannot be written; it is named.
        """
        self._scenario = scenario
        self._limits = {uav.id: scenario.aircraft_of(uav.id).fault_limits for uav in scenario.uavs}
        self._context = context = foxglove.Context()  # its channels end with it
        self._channels = {
            kind.topic(system): foxglove.Channel(
                kind.topic(system),
                message_encoding="json",
                schema=foxglove.Schema(
                    name=kind.schema_name, encoding="jsonschema", data=kind.schema
                ),
                context=context,
            )
            for kind, system in all_channels(self._limits)
        }
        self._scene = SceneUpdateChannel("/formation", context=context)
        self._frames = FrameTransformsChannel("/tf", context=context)
        layout = folder / LAYOUT
        with complete_file(layout) as file:
            file.write(layout_of(list(self._limits)).encode())
        try:
            self._server = foxglove.start_server(
                name=scenario.name, host=address.host, port=address.port, context=context
            )
        except Exception as problem:  # the SDK's own, of whatever kind
            raise BadInput(f"--foxglove: cannot serve at {address}: {problem}") from problem
        self.url = f"ws://{address}"
        self.lines = (
            f"Foxglove: open {self._server.app_url()}",
            f"or a connection to {self.url} in its desktop app; layout to import: {layout}",
        )

    def stop(self) -> None:
        """End all connections."""
        self._server.stop()

    def feed(self, hub: UdpAddress, observer: Observer) -> None:
        """Send what a ground station hears at the hub, as long as the observer goes on.

        Raises:
            Exception: Whatever failed; nothing is sent any more.
        """
        asyncio.run(self._feed(hub, observer))

    async def _feed(self, hub: UdpAddress, observer: Observer) -> None:
        live = LiveChannels(self._limits, self._publish)
        problems: list[Exception] = []
        client = Client(
            Connection("out", hub),
            on_message=_noting(problems, live.receive),
            on_notification=_noting(problems, live.notify),
            inquire=True,
            private=True,
            own=own_identity(),
            signing_key=self._scenario.links.signing_key,
        )
        live.fleet = client.fleet
        scene = FormationScene()
        async with client:
            while observer.goes_on() and not problems:
                await asyncio.sleep(_SCENE_S)
                if self._scene.has_sinks() or self._frames.has_sinks():
                    self._draw(scene, client)
        if problems:
            raise problems[0]

    def _publish(
        self, kind: ChannelKind, system: int, time_s: float, make: Callable[[], Mapping[str, Any]]
    ) -> None:
        channel = self._channels[kind.topic(system)]
        if channel.has_sinks():
            channel.log(encoded(make()), log_time=nanoseconds(time_s))

    def _draw(self, scene: FormationScene, client: Client) -> None:
        states = list(client.fleet.vehicles.values())
        times = [state.time_s for state in states if state.time_s is not None]
        if times:
            entities, frames = scene.update(states)
            self._frames.log(frames, log_time=nanoseconds(max(times)))
            self._scene.log(entities, log_time=nanoseconds(max(times)))


def _noting(problems: list[Exception], take: Callable[[T], None]) -> Callable[[T], None]:
    """Return the same, which notes what is raised: the event loop would only print it."""

    def noting(something: T) -> None:
        try:
            take(something)
        except Exception as problem:
            problems.append(problem)

    return noting
