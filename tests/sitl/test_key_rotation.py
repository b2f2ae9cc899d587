"""The key of a fleet is replaced while it flies."""

from pathlib import Path

import pytest
from flying import run, wait_until
from station import ALL, NO_ANSWER, up

from mavlink_defs.framing.signing import make_key, read_key

pytestmark = pytest.mark.sitl


def test_a_fleet_in_flight_goes_over_to_a_new_key(tmp_path: Path) -> None:
    """Slowly: a busy machine may be late by more than the loops of a flight bear."""
    key = tmp_path / "key"
    make_key(key)
    make_key(tmp_path / "old", read_key(key))
    options = ("--signing-key", key)
    with up(tmp_path / "fleet", "--start", "--speed", "0.1", *options) as fleet:

        def hears(file: Path) -> bool:
            """Whether a station that has only this key receives the state of every vehicle."""
            done = fleet.gcs("status", *ALL, "--json", "--signing-key", file)
            assert done.returncode in {0, NO_ANSWER}, done.stderr
            return bool(done.returncode == 0)

        assert hears(tmp_path / "old")
        assert run("gcs", "key", key, "--replace").returncode == 0
        make_key(tmp_path / "new", read_key(key))
        wait_until(lambda: hears(tmp_path / "new"), "the fleet signs with the new key")
        assert hears(key)
        wait_until(lambda: not hears(tmp_path / "old"), "the former key has expired")
        status, stderr = fleet.stop()
        assert status == 0, stderr
        logs = "".join(log.read_text() for log in (fleet.folder / "processes").glob("*.log"))
        assert "wrong signature" not in logs
