"""A ground station for programs: vehicles, faults, missions, subscriptions, all by MAVLink."""

import asyncio
import contextlib
from collections import deque
from collections.abc import AsyncIterator, Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Generic, Self, TypeVar
from weakref import WeakSet

from gcs.api.errors import python_errors
from gcs.errors import BadInput
from gcs.scenario.itinerary import load_mission
from gcs.scenario.profile_file import load_profile
from gcs.station.client import Client
from gcs.station.connection import choose_connection, own_identity
from gcs.station.fault_keys import fault_of, sensor_fault_of
from gcs.station.mission import Mission
from gcs.station.notifications import Notification
from gcs.station.vehicle import Vehicle
from gcs.station.vehicle_state import VehicleState
from mavlink_defs.constants import ACTUATORS
from mavlink_defs.dialect import MAVLink_message
from mavlink_defs.faults.fault import Fault
from mavlink_defs.faults.sensors import SENSOR_NAMES
from mavlink_defs.profile import Segment
from mavlink_defs.services.param import Param

_T = TypeVar("_T")

_MOST_WAITING = 10_000  # of what a subscriber has not looked at


class Uav:
    """One vehicle of a fleet; each call returns once it has answered.

    Calls raise `gcs.errors.CommandRefused` if it refuses and `gcs.errors.NoAnswer` if it does not
    answer.

    Attributes:
        id: Its system id.
        vehicle: The same for more general calls, such as any MAV_CMD.
    """

    def __init__(self, vehicle: Vehicle, station: "Station") -> None:
        self.id = vehicle.system
        self.vehicle = vehicle
        self._station = station

    def __repr__(self) -> str:
        return f"<UAV {self.id}>"

    @property
    def state(self) -> VehicleState:
        """What is known of it: mode, arming, latest messages, event counts, faults, mission."""
        return self.vehicle.state

    async def arm(self) -> None:
        """Arm; simulated time begins when the last vehicle of the fleet is armed."""
        await self.vehicle.arm()

    async def disarm(self, force: bool = False) -> None:
        """Disarm; in flight only with `force`, which cuts the thrust."""
        await self.vehicle.disarm(force)

    async def start_mission(self) -> None:
        """Start flying the mission, or the profile."""
        await self.vehicle.start_mission()

    async def set_mode(self, mode: str) -> None:
        """Change the mode: "AUTO", "LOITER", "RTL" or "GUIDED"."""
        await self.vehicle.set_mode(mode)

    async def set_fault(
        self, actuator: str, *, start_s: float | None = None, **keys: float
    ) -> None:
        """Set an actuator fault, with the keys of a scenario's `faults`.

        Args:
            actuator: "aileron", "elevator", "rudder" or "throttle".
            start_s: Start in simulated time [s]; None for now.
            **keys: Such as `effectiveness`, `bias_deg`, `stuck_deg`, `end_s`.

        Raises:
            BadInput: They do not describe a fault.
        """
        await self.vehicle.set_fault(fault_of(actuator, start_s, **keys))

    async def set_sensor_fault(
        self,
        sensor: str,
        failure: str | None = None,
        *,
        instance: int = 0,
        axis: str | None = None,
        start_s: float | None = None,
        **keys: float,
    ) -> None:
        """Set a fault of a navigation sensor, with the keys of a scenario's `faults`.

        Args:
            sensor: "gyro", "accelerometer", "magnetometer", "barometer", "gps" or "airspeed".
            failure: "off", "stuck", "garbage", "wrong", "slow", "delayed" or "intermittent"; None
                if a value says it.
            instance: Number of the sensor from 1; 0 for all.
            axis: "x", "y" or "z" of what is wrong; None for all.
            start_s: Start in simulated time [s]; None for now.
            **keys: Such as `bias_deg_s`, `fade_s`, `noise_factor`, `end_s`.

        Raises:
            BadInput: They do not describe a fault.
        """
        fault = sensor_fault_of(
            sensor, failure, instance=instance, axis=axis, start_s=start_s, **keys
        )
        await self.vehicle.set_fault(fault)

    async def clear_sensor_faults(self, sensor: str, instance: int = 0) -> None:
        """Clear the faults of a sensor; an instance of 0 is all of them.

        Raises:
            BadInput: There is no such sensor.
        """
        known = {str(name): name for name in SENSOR_NAMES}
        if sensor not in known:
            raise BadInput(f"sensor: expected {', '.join(SENSOR_NAMES)}, got {sensor!r}")
        await self.vehicle.clear_sensor_faults(known[sensor], instance)

    async def clear_faults(self, actuator: str | None = None) -> None:
        """Clear the faults of one actuator, or all, also of sensors.

        Raises:
            BadInput: There is no such actuator.
        """
        if actuator is not None and actuator not in ACTUATORS:
            raise BadInput(f"actuator: expected {', '.join(ACTUATORS)}, got {actuator!r}")
        index = None if actuator is None else ACTUATORS.index(actuator)
        await self.vehicle.clear_faults(index)

    async def faults(self) -> tuple[Fault, ...]:
        """Return its faults, including past and future ones."""
        return await self.vehicle.list_faults()

    async def upload_mission(self, mission: Mission | Path | str) -> None:
        """Upload a mission: items, home included, or a file of `gcs mission upload`.

        Raises:
            BadInput: The file cannot be used.
        """
        with python_errors():
            items = (
                load_mission(Path(mission)).items if isinstance(mission, Path | str) else mission
            )
        await self.vehicle.upload_mission(items)

    async def download_mission(self) -> Mission:
        """Download its mission, home included."""
        return await self.vehicle.download_mission()

    async def upload_profile(self, profile: tuple[Segment, ...] | Path | str) -> None:
        """Upload a reference profile: segments, or a file of `gcs profile upload`.

        Raises:
            BadInput: The file cannot be used.
        """
        with python_errors():
            segments = load_profile(profile) if isinstance(profile, Path | str) else profile
        await self.vehicle.upload(segments)

    async def download_profile(self) -> tuple[Segment, ...]:
        """Download its profile, empty if it has none."""
        return await self.vehicle.download()

    async def get_param(self, name: str) -> Param:
        """Read a parameter."""
        return await self.vehicle.get_param(name)

    async def set_param(self, name: str, value: float) -> Param:
        """Set a parameter, and return it as the vehicle then holds it."""
        return await self.vehicle.set_param(name, value)

    def messages(self, name: str | None = None) -> "Subscription[MAVLink_message]":
        """Subscribe to its messages; as of `Station.messages`."""
        return self._station.messages(name, uav=self.id)


class Station(Mapping[int, Uav]):
    """A ground station that is connected to a fleet: its vehicles by system id.

    Attributes:
        client: The client behind it.
    """

    def __init__(self, client: Client, feeds: "_Feeds") -> None:
        self.client = client
        self._feeds = feeds

    def __getitem__(self, system: int) -> Uav:
        return Uav(self.client.vehicle(system), self)

    def __iter__(self) -> Iterator[int]:
        return iter(self.client.vehicles)

    def __len__(self) -> int:
        return len(self.client.vehicles)

    def __repr__(self) -> str:
        return f"<station on {self.client.connection} with UAV {', '.join(map(str, self))}>"

    async def start(self) -> None:
        """Start the missions of all vehicles, and arm them: simulated time begins."""
        await asyncio.gather(*(uav.start_mission() for uav in self.values()))
        await asyncio.gather(*(uav.arm() for uav in self.values()))

    def messages(
        self, name: str | None = None, *, uav: int | None = None
    ) -> "Subscription[MAVLink_message]":
        """Subscribe to messages.

        Args:
            name: Of the message, such as "ATTITUDE"; None for all.
            uav: System id of the sender; None for all.
        """

        def is_of_interest(message: MAVLink_message) -> bool:
            return name in {None, message.get_type()} and uav in {None, message.get_srcSystem()}

        return self._feeds.messages.subscribe(is_of_interest)

    def notifications(self) -> "Subscription[Notification]":
        """Subscribe to the event log: changes of mode, texts, answers, faults, lost links."""
        return self._feeds.notifications.subscribe(lambda _: True)


class Subscription(Generic[_T]):
    """What is received from now on, for ``async for``; it ends with the connection.

    The oldest of 10 000 that wait are dropped for newer ones.
    """

    def __init__(self, is_of_interest: Callable[[_T], bool]) -> None:
        self._is_of_interest = is_of_interest
        self._waiting: deque[_T] = deque(maxlen=_MOST_WAITING)
        self._changed = asyncio.Event()
        self._over = False

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> _T:
        while not self._waiting:
            if self._over:
                raise StopAsyncIteration
            self._changed.clear()
            await self._changed.wait()
        return self._waiting.popleft()

    def put(self, one: _T) -> None:
        """Pass something on, if it is of interest."""
        if self._is_of_interest(one):
            self._waiting.append(one)
            self._changed.set()

    def end(self) -> None:
        """Let it end after what waits."""
        self._over = True
        self._changed.set()


class _Feed(Generic[_T]):
    """Passes what comes to all who have subscribed and still hold their subscription."""

    def __init__(self) -> None:
        self._subscriptions: WeakSet[Subscription[_T]] = WeakSet()

    def subscribe(self, is_of_interest: Callable[[_T], bool]) -> Subscription[_T]:
        subscription = Subscription(is_of_interest)
        self._subscriptions.add(subscription)
        return subscription

    def put(self, one: _T) -> None:
        for subscription in list(self._subscriptions):
            subscription.put(one)

    def end(self) -> None:
        for subscription in list(self._subscriptions):
            subscription.end()


class _Feeds:
    def __init__(self) -> None:
        self.messages = _Feed[MAVLink_message]()
        self.notifications = _Feed[Notification]()


@contextlib.asynccontextmanager
async def connect(
    address: str | None = None,
    *,
    uavs: Collection[int] | None = None,
    timeout_s: float = 5.0,
    signing_key: Path | str | None = None,
) -> AsyncIterator[Station]:
    """Connect to a running fleet, as the commands of `gcs` do.

    As in::

        async with connect() as fleet:
            await fleet.start()
            await fleet[3].set_fault("rudder", effectiveness=0.5)
            async for message in fleet[3].messages("ATTITUDE"):
                print(message.roll)

    Args:
        address: ``udpin:HOST:PORT`` or ``udpout:HOST:PORT``; None for the hub of `gcs up` if there
            is one, else the port of ground stations.
        uavs: System ids to wait for; None for the whole fleet of whoever is heard.
        timeout_s: How long to wait for them [s].
        signing_key: Key file; with one, unsigned frames are refused.

    Yields:
        The station; every vehicle that was waited for has been heard.

    Raises:
        BadInput: The address, the port or the key cannot be used.
        NoAnswer: No vehicle was heard, or not all.
    """
    feeds, key = _Feeds(), None if signing_key is None else str(signing_key)
    with python_errors():
        client = Client(
            choose_connection(address, key),
            on_message=feeds.messages.put,
            on_notification=feeds.notifications.put,
            inquire=True,
            private=True,
            own=own_identity(),
            signing_key=key,
        )
        async with client:
            await client.discover(timeout_s, uavs)
            try:
                yield Station(client, feeds)
            finally:
                feeds.messages.end()
                feeds.notifications.end()
