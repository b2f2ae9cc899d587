import socket
from pathlib import Path

import pytest

from gcs.console.errors import BadInput
from gcs.station import connection
from gcs.station.connection import choose_connection, own_identity
from mavlink_defs.endpoint import EndpointError, UdpAddress, parse_connection, someone_listens
from mavlink_defs.ports import GCS_PORT, HUB_PORT


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("udpin:0.0.0.0:14550", "udpin:0.0.0.0:14550"),
        ("udpin://0.0.0.0:14550", "udpin:0.0.0.0:14550"),
        ("udp:127.0.0.1:14550", "udpin:127.0.0.1:14550"),
        ("127.0.0.1:14550", "udpin:127.0.0.1:14550"),
        ("udpout:10.0.0.1:1", "udpout:10.0.0.1:1"),
        (" udpout://10.0.0.1:1 ", "udpout:10.0.0.1:1"),
    ],
)
def test_spellings(text: str, expected: str) -> None:
    assert str(parse_connection(text)) == expected


@pytest.mark.parametrize("text", ["", "tcp:127.0.0.1:5760", "udpin:127.0.0.1", "udpout:h:70000"])
def test_what_is_no_connection_is_refused(text: str) -> None:
    with pytest.raises(EndpointError, match="udpin:host:port"):
        parse_connection(text)
    with pytest.raises(BadInput, match="--connect"):
        choose_connection(text)


def test_the_hub_comes_first_if_there_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        port = sock.getsockname()[1]
        monkeypatch.setattr(connection, "HUB_PORT", port)
        assert someone_listens(UdpAddress("127.0.0.1", port))
        assert str(choose_connection(None)) == f"udpout:127.0.0.1:{port}"
    assert not someone_listens(UdpAddress("127.0.0.1", port))
    assert str(choose_connection(None)) == "udpin:127.0.0.1:14550"


def test_processes_one_after_the_other_have_different_identities(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen = set()
    for pid in range(1000, 1050):
        monkeypatch.setattr("os.getpid", lambda pid=pid: pid)
        seen.add(own_identity())
    assert len(seen) == 50
    assert all(system == 255 and 25 <= component <= 99 for system, component in seen)


def test_default_ports_are_documented() -> None:
    text = (Path(__file__).parents[4] / "docs" / "how-to" / "station.md").read_text()
    assert str(HUB_PORT) in text
    assert str(GCS_PORT) in text
