"""Every --out behaves alike: folders are made, wrong places refused, no failure leaves anything."""

import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from run_folders import make_run

from gcs.commands.cli import main, whole_command
from gcs.console import outputs

SHORT = "--set duration_s=0.02"
FLY = f"paper/scenario1 {SHORT} --in-process --no-figures"
NOWHERE = "--connect udpout:127.0.0.1:1 --timeout 0.1"
FILES = {
    "diagnose": "diagnose flight.csv",
    "design": "design aerosonde --law tube",
    "estimate": "estimate flight.csv",
    "identify": "identify own:aerosonde --cruise 24",
    "mission download": f"mission download {NOWHERE}",
    "profile download": f"profile download {NOWHERE}",
    "runs html": "runs html runs",
    "wireshark": "wireshark",
}
"""Commands whose --out is a file."""
FOLDERS = {
    "aircraft": "aircraft aerosonde",
    "baseline": f"baseline paper/scenario1 {SHORT}",
    "campaign": "campaign campaigns/uncertainty --draws 2",
    "config": f"config paper/scenario1 {SHORT}",
    "export": "export runs/one --to csv",
    "fly": f"fly {FLY}",
    "replay-fault": "replay-fault flight.csv --aircraft aerosonde",
    "reproduce": "reproduce",
    "sweep": f"sweep paper/scenario1 {SHORT} --set seed=1,2 --jobs 1",
    "up": "up paper/scenario1 --free-ports",
}
"""Commands whose --out is a folder."""
QUICK = ("aircraft", "config", "export", "fly", "design", "runs html", "wireshark")
"""Those that work in no time."""
KINDS = {**dict.fromkeys(FILES, "mine.plan"), **dict.fromkeys(FOLDERS, "folder")}
LIMITED = {
    **{name: f"{(FILES | FOLDERS)[name]} --out OUT" for name in QUICK if name != "wireshark"},
    **{f"export {to}": f"export runs/one --to {to} --out OUT" for to in ("npz", "mcap", "ulg")},
    "sweep": f"{FOLDERS['sweep']} --out OUT",
    "new": "new OUT",
    "new --project": "new --project deep/my-law --source https://example.org/a.whl",
    "runs note": "runs note runs/one text",
}


@pytest.fixture
def gcs(
    tmp_path_factory: pytest.TempPathFactory,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> Iterator[Callable[..., tuple[int, str]]]:
    """Run a command line beside a run folder; return its exit status, and what it said last."""
    cache = tmp_path_factory.getbasetemp() / "of_outputs"
    cache.mkdir(exist_ok=True)
    make_run(cache, tmp_path / "runs" / "one")
    monkeypatch.chdir(tmp_path)
    handlers = {number: signal.getsignal(number) for number in (15, 1, 2, signal.SIGXFSZ)}
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    def run(line: str, size: int = resource.RLIM_INFINITY) -> tuple[int, str]:
        monkeypatch.setattr("sys.argv", ["gcs", *line.split()])
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
        try:
            with pytest.raises(SystemExit) as end:
                main()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
        code: Any = end.value.code
        return int(code or 0), capsys.readouterr().err

    yield run
    for number, handler in handlers.items():
        signal.signal(number, handler)


def everything(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


@pytest.mark.parametrize("command", KINDS)
def test_a_wrong_place_is_refused_in_a_line(
    command: str, gcs: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    wrong = tmp_path / KINDS[command]
    (wrong.mkdir if command in FILES else wrong.touch)()
    (tmp_path / "file").touch()
    before = everything(tmp_path)
    other = "a folder, expected a file" if command in FILES else "a file, expected a folder"
    refusals = {wrong.name: f"--out is {wrong.name}, {other}"}
    refusals["file/below.plan"] = "--out is file/below.plan, but file is a file"
    for place, refusal in refusals.items():
        status, said = gcs(f"{(FILES | FOLDERS)[command]} --out {place}")
        assert status == 2, said
        errors = [line for line in said.splitlines() if line.startswith("error: ")]
        assert errors == [f"error: {refusal}"]
        assert "defect" not in said
    assert everything(tmp_path) == before


@pytest.mark.parametrize("command", QUICK)
def test_folders_are_made(
    command: str, gcs: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    status, said = gcs(f"{(FILES | FOLDERS)[command]} --out new/deep/mine")
    assert status == 0, said
    place = tmp_path / "new" / "deep" / "mine"
    assert place.is_file() if command in FILES else any(place.iterdir())


@pytest.mark.parametrize("command", LIMITED)
def test_nothing_is_left_of_what_cannot_be_written(
    command: str, gcs: Callable[..., tuple[int, str]], tmp_path: Path
) -> None:
    before = everything(tmp_path)
    status, said = gcs(LIMITED[command].replace("OUT", "new/deep/mine"), size=0)
    assert status in {1, 2}, said
    (error,) = [line for line in said.splitlines() if line.startswith("error: ")]
    assert "File too large" in error
    assert ".part" not in said
    assert everything(tmp_path) - {"runs/.runs.sqlite"} == before  # the list that is kept
    assert not outputs._made


def test_every_out_is_here() -> None:
    def walk(command: Any, *names: str) -> Iterator[str]:
        for name, inner in getattr(command, "commands", {}).items():
            yield from walk(inner, *names, name)
        if not hasattr(command, "commands"):
            options = {option for one in command.params for option in one.opts}
            if options & {"--out", "-o"}:
                yield " ".join(names)

    assert set(walk(whole_command())) == FILES.keys() | FOLDERS.keys()


def test_output_that_is_closed_is_no_defect() -> None:
    done = subprocess.run(
        ["bash", "-c", f"{sys.executable} -m gcs wireshark | head -c 10"],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[4])},
        timeout=600,
    )
    assert done.stderr == ""
