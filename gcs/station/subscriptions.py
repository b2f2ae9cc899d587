"""What a client receives, passed on to whoever has subscribed to it."""

import asyncio
import contextlib
from collections import deque
from collections.abc import Callable
from typing import Generic, Self, TypeVar
from weakref import WeakSet

_T = TypeVar("_T")

_MAX_WAITING = 10_000  # of what a subscriber has not looked at


class Subscription(Generic[_T]):
    """What is received from now on, for ``async for``; it ends with the connection.

    The oldest of 10 000 that wait are dropped for newer ones.
    """

    def __init__(self, is_of_interest: Callable[[_T], bool]) -> None:
        self._is_of_interest = is_of_interest
        self._waiting: deque[_T] = deque(maxlen=_MAX_WAITING)
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

    async def comes_within(self, timeout_s: float) -> bool:
        """Wait for the next one; return whether it has come."""
        with contextlib.suppress(TimeoutError, StopAsyncIteration):
            async with asyncio.timeout(timeout_s):
                await anext(self)
                return True
        return False

    def put(self, one: _T) -> None:
        """Pass something on, if it is of interest."""
        if self._is_of_interest(one):
            self._waiting.append(one)
            self._changed.set()

    def end(self) -> None:
        """Let it end after what waits."""
        self._over = True
        self._changed.set()


class Feed(Generic[_T]):
    """Passes what comes to all who have subscribed and still hold their subscription."""

    def __init__(self, listener: Callable[[_T], None] | None = None) -> None:
        """Pass nothing on yet.

        Args:
            listener: Called with all that comes, before the others get it.
        """
        self._listener = listener
        self._subscriptions: WeakSet[Subscription[_T]] = WeakSet()

    def subscribe(self, is_of_interest: Callable[[_T], bool]) -> Subscription[_T]:
        """Subscribe to what is of interest, from now on."""
        subscription = Subscription(is_of_interest)
        self._subscriptions.add(subscription)
        return subscription

    def put(self, one: _T) -> None:
        """Pass something on."""
        if self._listener is not None:
            self._listener(one)
        for subscription in list(self._subscriptions):
            subscription.put(one)

    def end(self) -> None:
        """End all subscriptions."""
        for subscription in list(self._subscriptions):
            subscription.end()
