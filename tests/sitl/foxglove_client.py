"""A client of Foxglove's WebSocket protocol, written from its specification (foxglove.sdk.v1)."""

import asyncio
import json
import struct
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from aiohttp import ClientSession, ClientWebSocketResponse, WSMsgType
from flying import TIMEOUT_S

_MESSAGE = struct.Struct("<BIQ")  # opcode, subscription, log time [ns]
_MESSAGE_DATA = 1

Received = tuple[int, Any]
"""Log time [ns], and the message: decoded JSON, or bytes of another encoding."""


class FoxgloveClient:
    """A connection.

    Attributes:
        channels: What the server advertises, by topic.
        messages: What was received, by topic.
    """

    def __init__(self, connection: ClientWebSocketResponse) -> None:
        self.channels: dict[str, dict[str, Any]] = {}
        self.messages: dict[str, list[Received]] = {}
        self._connection = connection
        self._topics: dict[int, str] = {}

    async def subscribe(self, *topics: str) -> None:
        await self.until(lambda: self.channels.keys() >= set(topics))
        new = []
        for topic in topics:
            number = len(self._topics)
            self._topics[number] = topic
            self.messages[topic] = []
            new.append({"id": number, "channelId": self.channels[topic]["id"]})
        await self._connection.send_json({"op": "subscribe", "subscriptions": new})

    async def until(self, condition: Callable[[], bool]) -> None:
        """Receive until a condition holds."""
        async with asyncio.timeout(TIMEOUT_S):
            while not condition():
                self._take(await self._connection.receive())

    def _take(self, message: Any) -> None:
        if message.type == WSMsgType.TEXT:
            content = json.loads(message.data)
            if content["op"] == "advertise":
                self.channels |= {channel["topic"]: channel for channel in content["channels"]}
            return
        assert message.type == WSMsgType.BINARY, message
        if message.data[0] != _MESSAGE_DATA:
            return
        _, number, time_ns = _MESSAGE.unpack_from(message.data)
        topic, data = self._topics[number], message.data[_MESSAGE.size :]
        is_json = self.channels[topic]["encoding"] == "json"
        self.messages[topic].append((time_ns, json.loads(data) if is_json else data))


@asynccontextmanager
async def foxglove_client(address: str) -> AsyncIterator[FoxgloveClient]:
    """Connect to a server at HOST:PORT."""
    async with (
        ClientSession() as session,
        session.ws_connect(
            f"ws://{address}", protocols=("foxglove.sdk.v1",), max_msg_size=0
        ) as connection,
    ):
        assert connection.protocol == "foxglove.sdk.v1"
        yield FoxgloveClient(connection)
