"""What commands print at 80 columns and in a pipe: nothing is cut, no number is split."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from capture_writer import pcap, udp_packet
from printed import BY_ITSELF, NO_TABLE, OF_A_FLEET, assert_same_numbers
from typer.testing import CliRunner

from gcs import tui
from gcs.commands.cli import app, whole_command
from gcs.tui.dialogs import key_name
from mavlink_defs import dialect
from mavlink_defs.config.yaml_text import yaml_of
from mavlink_defs.framing.frames import FramePacker

DATA = Path(__file__).parents[3] / "data"
MASS = {"uncertainty.mass": {"draw": {"kind": "uniform", "low": 0.9, "high": 1.1}}}
CAMPAIGN = {"name": "camp", "scenario": "base.yaml", "design": "random", "draws": 2}


def commands(command: Any, *names: str) -> Iterator[str]:
    inner = getattr(command, "commands", {})
    for name in inner:
        yield from commands(inner[name], *names, name)
    if not inner:
        yield " ".join(names)


def test_every_command_is_rendered_or_has_no_table() -> None:
    rendered = {name.strip() for name in (*BY_ITSELF, *OF_A_FLEET)}
    assert sorted(commands(whole_command())) == sorted(rendered | set(NO_TABLE))
    assert not rendered & set(NO_TABLE)


def shown(arguments: list[str], monkeypatch: pytest.MonkeyPatch, columns: str) -> str:
    """What a command prints at a width; without one in a pipe. No figures: nobody looks at them."""
    monkeypatch.setenv("FTC_SITL_NO_FIGURES", "1")
    if columns:
        monkeypatch.setenv("COLUMNS", columns)
    else:
        monkeypatch.delenv("COLUMNS", raising=False)
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, (done.exception, done.stderr)
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two small campaigns that were flown, one that was not, two flights, and a capture."""
    folder = tmp_path_factory.mktemp("inputs")
    base = {"extends": "paper/scenario1", "duration_s": 0.05, "faults": []}
    (folder / "base.yaml").write_text(yaml_of(base))
    for seed, name in enumerate(("old", "new", "campaign")):
        file = folder / f"{name}.yaml"
        file.write_text(yaml_of({**CAMPAIGN, "seed": seed, "factors": MASS}))
        if name != "campaign":
            arguments = ["campaign", str(file), "--jobs", "1", "--out", str(folder / name)]
            assert CliRunner().invoke(app, arguments).exit_code == 0
    for name, law in (("one", "proposed"), ("two", "surviving")):
        options = f"--set controller.kind={law} --in-process --no-figures --out"
        arguments = ["fly", str(folder / "base.yaml"), *options.split()]
        assert CliRunner().invoke(app, [*arguments, str(folder / "flights" / name)]).exit_code == 0
    (folder / "flight.tlog").write_bytes((DATA / "others" / "mavlink1.tlog").read_bytes())
    packer = FramePacker(7, 1)
    commanded = [
        packer.pack(dialect.MAVLink_hil_actuator_controls_message(k, [0.1 * k] * 16, 0, 0))
        for k in range(1, 4)
    ]
    said = packer.pack(dialect.MAVLink_statustext_message(4, b"x"))
    addresses = ("127.0.0.1", 40123), ("127.0.0.1", 14560)
    datagrams = [udp_packet(*addresses, d) for d in (*commanded, said, b"\xfd\x09 damaged")]
    (folder / "capture.pcap").write_bytes(pcap(list(enumerate(datagrams)), "ethernet"))
    return folder


@pytest.mark.parametrize("name", BY_ITSELF)
def test_nothing_is_cut(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    texts = []
    for columns in ("80", ""):
        out = f"{name.replace(' ', '-')}{columns}"
        arguments = shlex.split(f"{name} {BY_ITSELF[name].replace('OUT', out)}")
        texts.append(shown(arguments, monkeypatch, columns).replace(out, "OUT"))
    assert_same_numbers(name.strip(), *texts)


def test_trim_fits_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    text = shown(["trim", "paper/scenario1", "--airspeed", "50"], monkeypatch, "80")
    assert sum("stuck:" in line for line in text.splitlines()) == 2


def test_keys_have_the_names_on_the_keyboard() -> None:
    bound = set()
    for path in Path(next(iter(tui.__path__))).rglob("*.py"):
        bound.update(re.findall(r'Binding\(\s*"([^"]+)"', path.read_text()))
    assert len(bound) > 20
    assert [key for key in bound if "_" in key_name(key)] == []
