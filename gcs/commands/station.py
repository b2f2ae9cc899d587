"""Shared by the commands that talk to a running fleet: options, outcomes, exit status.

Such a command does the same with every chosen vehicle concurrently, and reports each outcome:
successes on standard output, everything else on standard error.
"""

import inspect
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

import typer

from gcs.commands.options import (
    ConnectOption,
    JsonOption,
    SigningKeyOption,
    TimeoutOption,
    UavOption,
    options_of,
    with_options,
)
from gcs.console.errors import BadInput, CommandRefused, Interrupted, NoAnswer
from gcs.console.lines import print_json, print_line

if TYPE_CHECKING:
    from gcs.station.client import Client
    from gcs.station.vehicle import Vehicle

_EXIT_STATUS = """

Exit status: 0 accepted or answered by all, 2 bad input, 3 refused by one, 4 no answer from one
(or, before anything was sent, a member of the fleet was not heard)."""

T = TypeVar("T")

_SLOW = 6  # times the time-out: the wait for a vehicle that is heard
_LOOK_S = 0.2


@dataclass(frozen=True)
class _Outcome:
    """The outcome of an action: "accepted", "refused" or "no answer", and its text."""

    uav: int
    outcome: str
    text: str
    status: int = 0
    data: dict[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        reason = {} if self.outcome == "accepted" else {"reason": self.text}
        return {"uav": self.uav, "outcome": self.outcome, **reason, **self.data}


@dataclass(frozen=True)
class StationOptions:
    """The options of all commands that talk to vehicles, and their access to vehicles."""

    uav: UavOption = None
    connect: ConnectOption = None
    timeout: TimeoutOption = 10.0
    as_json: JsonOption = False
    signing_key: SigningKeyOption = None

    @property
    def systems(self) -> set[int] | None:
        """System ids of the chosen vehicles; None: the fleet, and all others that are heard.

        Raises:
            BadInput: The option is no list of ids.
        """
        return None if self.uav is None else systems_in(self.uav)

    def act(
        self,
        action: "Callable[[Vehicle], Awaitable[str]]",
        data: "Callable[[Vehicle], dict[str, Any]]" = lambda _: {},
    ) -> None:
        """Apply an action to every chosen vehicle and report it; exit with its status.

        Args:
            action: Acts on a vehicle and returns a line for the user.
            data: Returns further JSON data of a vehicle after the action.
        """
        import asyncio

        async def with_vehicles(_: "Client", vehicles: "list[Vehicle]") -> list[_Outcome]:
            return await asyncio.gather(*(self._try(v, action, data) for v in vehicles))

        outcomes = self.run(with_vehicles)
        if self.as_json:
            print_json([outcome.as_dict() for outcome in outcomes])
        else:
            for outcome in outcomes:
                prefix = "error: " if outcome.status else ""
                print_line(prefix + outcome.text, stderr=outcome.status != 0)
        raise typer.Exit(max(outcome.status for outcome in outcomes))

    def do(self, operation: "Callable[[Vehicle], Awaitable[object]]", done: str) -> None:
        """Apply an operation to every chosen vehicle, and report that it is "UAV 1 done"."""

        async def action(vehicle: "Vehicle") -> str:
            await operation(vehicle)
            return f"UAV {vehicle.system} {done}"

        self.act(action)

    def run(
        self,
        work: "Callable[[Client, list[Vehicle]], Awaitable[T]]",
        *,
        inquire: bool = False,
        private: bool = False,
        whole: bool = True,
    ) -> T:
        """Run a coroutine with a client and the chosen vehicles.

        Args:
            work: Called with both.
            inquire: As of `Client`.
            private: As of `Client`.
            whole: As of `Client.discover`.

        Raises:
            BadInput: An option cannot be used.
            NoAnswer: No vehicle was heard, or one of the chosen or of the fleet was not.
        """
        from gcs.station.client import Client
        from gcs.station.connection import choose_connection, own_identity

        systems, connection = self.systems, choose_connection(self.connect, self.signing_key)

        async def connected() -> T:
            async with Client(
                connection,
                own=own_identity(),
                inquire=inquire,
                private=private,
                signing_key=self.signing_key,
            ) as client:
                try:
                    vehicles = await client.discover(self.timeout, systems, whole=whole)
                except NoAnswer as problem:
                    problem.hint = _hint(client, systems)
                    raise
                return await work(client, vehicles)

        return run_interruptible(connected())

    async def _try(
        self,
        vehicle: "Vehicle",
        action: "Callable[[Vehicle], Awaitable[str]]",
        data: "Callable[[Vehicle], dict[str, Any]]",
    ) -> _Outcome:
        uav = vehicle.system
        try:
            text = await self._while_it_lives(vehicle, action)
        except CommandRefused as problem:
            return _Outcome(uav, "refused", str(problem), problem.exit_status)
        except NoAnswer as problem:
            return _Outcome(uav, "no answer", str(problem), problem.exit_status)
        return _Outcome(uav, "accepted", text, data=data(vehicle))

    async def _while_it_lives(
        self, vehicle: "Vehicle", action: "Callable[[Vehicle], Awaitable[str]]"
    ) -> str:
        """Apply an action; wait for a vehicle that is heard longer than for a silent one.

        Raises:
            CommandRefused: As of the action.
            NoAnswer: It has not answered, and is silent, or is waited for no longer.
        """
        import asyncio

        from gcs.station.patience import Patience

        patience = Patience(answer_s=_SLOW * self.timeout)
        loop = asyncio.get_running_loop()
        begin_s, acting = (
            loop.time(),
            asyncio.ensure_future(action(vehicle.with_patience(patience))),
        )
        await asyncio.wait([acting], timeout=self.timeout)
        if not acting.done() and vehicle.is_heard:
            text = f"UAV {vehicle.system} is heard, and slow to answer: waiting"
            print_line(f"{text} up to {patience.answer_s:g} s", stderr=True)
        while not acting.done() and vehicle.is_heard and loop.time() - begin_s < patience.answer_s:
            await asyncio.wait([acting], timeout=_LOOK_S)
        if acting.done():
            return await acting
        acting.cancel()
        await asyncio.gather(acting, return_exceptions=True)
        within = f"within {loop.time() - begin_s:.3g} s"
        raise NoAnswer(f"UAV {vehicle.system} did not answer {within}{vehicle.last_heard}")


def station_command(command: Callable[..., None], timeout_s: float = 10.0) -> Callable[..., None]:
    """Return a command with the shared options of all station commands after its own.

    Its help gets the exit status of these, unless it has one of its own.

    Args:
        command: Gets the shared options as its argument `station`.
        timeout_s: Default of ``--timeout`` [s].
    """
    options = [
        option.replace(default=timeout_s) if option.name == "timeout" else option
        for option in options_of(StationOptions)
    ]
    signature = inspect.signature(command)
    own = [each for each in signature.parameters.values() if each.name != "station"]
    last = signature.parameters["station"].replace(kind=inspect.Parameter.KEYWORD_ONLY)
    command.__dict__["__signature__"] = signature.replace(
        parameters=[*(each.replace(kind=last.kind) for each in own), last]
    )
    text = inspect.cleandoc(command.__doc__ or "")
    command.__doc__ = text if "Exit status:" in text else text + _EXIT_STATUS
    return with_options("station", options, StationOptions)(command)


def run_interruptible(work: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine to its end; Ctrl-C ends the command with the status that shells expect."""
    import asyncio

    try:
        return asyncio.run(work)
    except KeyboardInterrupt:
        raise Interrupted("interrupted") from None


def _hint(client: "Client", systems: set[int] | None) -> str:
    """Return what to do if the vehicles that a command is for were not heard."""
    heard = ",".join(str(i) for i, vehicle in client.vehicles.items() if not vehicle.state.lost)
    if systems is None and heard:
        return f"no command was sent; --uav {heard} chooses those that are heard"
    return "start a fleet with `gcs up`, or give its address with --connect"


def systems_in(text: str) -> set[int]:
    """Read system ids, such as "1,3"; BadInput if the text is something else."""
    parts = text.split(",")
    if not all(part.strip().isdecimal() and 1 <= int(part) <= 255 for part in parts):
        raise BadInput(f"--uav: expected system ids 1 to 255 such as 1,3, got '{text}'")
    return {int(part) for part in parts}
