"""Unsigned links that other machines can reach are refused, by whichever command makes them."""

import sys
from pathlib import Path

import pytest

from gcs.commands import config as config_module
from gcs.commands.cli import main


@pytest.fixture
def gcs(monkeypatch, capsys):
    """Run a command line; its exit status and standard error."""
    monkeypatch.setattr(config_module, "warm_up", lambda *_: None)

    def run(*arguments: str | Path) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["gcs", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return int(ended.value.code or 0), capsys.readouterr().err

    return run


@pytest.mark.parametrize(
    ("host", "is_refused"),
    [
        ("uav2=10.0.0.2", True),
        ("gcs=0.0.0.0", True),
        ("plant=no-such-host.invalid", True),  # nobody knows where that is
        ("plant=127.0.0.2", False),
    ],
)
def test_files_for_other_hosts(gcs, host: str, is_refused: bool, tmp_path: Path) -> None:
    out, key = tmp_path / "fleet", tmp_path / "fleet.key"
    line = ("config", "paper/scenario1", "--out", out, "--host", host)
    status, err = gcs(*line)
    assert (status, out.exists()) == ((2, False) if is_refused else (0, True))
    if is_refused:
        name, _, address = host.partition("=")
        assert f"--host of {name} is {address}, which other machines can reach" in err
        assert "--insecure" in err
    key.write_bytes(bytes(range(32)))
    key.chmod(0o600)
    assert gcs(*line, "--insecure") == gcs(*line, "--signing-key", key) == (0, "")


@pytest.mark.parametrize("command", ["up", "config"])
def test_a_scenario_for_others(gcs, command: str, tmp_path: Path) -> None:
    out = ("--out", tmp_path / "out", *(("--free-ports",) if command == "up" else ()))
    status, err = gcs(command, "paper/scenario1", "--set", "links.host=0.0.0.0", *out)
    assert status == 2
    assert "is 0.0.0.0, which other machines can reach" in err
