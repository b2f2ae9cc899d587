"""How `make` fills .venv: from the locks, again after an interruption, in one line if it cannot."""

import importlib.util
import re
import shutil
import subprocess
import sys
import threading
import time
from importlib.metadata import packages_distributions
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
IMPORT_WITHOUT = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {absent!r}:
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Absent())
import gcs.fleet.precompile, gcs.fleet.warm_up
"""


@pytest.fixture
def setup(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, for an empty clone."""
    spec = importlib.util.spec_from_file_location("setup_script", ROOT / "scripts" / "setup.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "setup_script", module)
    spec.loader.exec_module(module)
    places = {"ROOT": tmp_path, "VENV": tmp_path / ".venv", "BUILD": tmp_path / "build"}
    for name, place in (places | {"MARK": tmp_path / ".venv" / "half-done"}).items():
        monkeypatch.setattr(module, name, place)
    (tmp_path / "build").mkdir()
    return module


def environment(setup: ModuleType) -> Path:
    """An environment that works, with a package in it."""
    (setup.VENV / "bin").mkdir(parents=True)
    (setup.VENV / "bin" / "python").symlink_to(sys.executable)
    (setup.VENV / "package").write_text("")
    return Path(setup.VENV)


def test_what_flies_is_a_part_of_all_with_equal_versions_and_hashes(setup: ModuleType) -> None:
    fly, whole = (setup.locked(setup.LOCKS[what]) for what in ("fly", "all"))
    assert len(whole) > 2 * len(fly) > 60
    entry = re.compile(r"^\S+==\S+|sha256:\w+", re.MULTILINE)
    for name, text in fly.items():
        assert entry.findall(text) == entry.findall(whole[name]), name
    assert not {"scipy", "pymavlink", "lxml", "mcap", *setup.BESIDE} & {*fly}
    assert {*setup.BESIDE} <= {*whole}


def test_the_lock_is_what_pip_reads(setup: ModuleType) -> None:
    text = setup.LOCKS["all"].read_text()
    entries = "".join(setup.locked(setup.LOCKS["all"]).values())
    assert sorted(entries.splitlines()) == sorted(
        line for line in text.splitlines() if not line.startswith("#")
    )


def test_the_compilation_imports_nothing_but_the_first_packages(setup: ModuleType) -> None:
    assert {*setup.FIRST} <= {*setup.locked(setup.LOCKS["fly"])}
    ours = {"gcs", "ftc_lab", "ftc_autopilot", "sitl_plant", "mavlink_defs"}
    canonical = {
        module: {name.lower().replace("_", "-") for name in names}
        for module, names in packages_distributions().items()
    }
    absent = {module for module, names in canonical.items() if not names & {*setup.FIRST}} - ours
    assert {"pyarrow", "matplotlib", "scipy"} <= absent
    code = IMPORT_WITHOUT.replace("{absent!r}", repr(absent))
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()


def test_what_the_compilation_is_called_by_exists(setup: ModuleType) -> None:
    """A fresh clone runs it, and no other test does."""
    found = re.findall(r"^from ([\w.]+) import (\w+)", setup.COMPILE, re.MULTILINE)
    assert ("gcs.fleet.warm_up", "warm_up") in found
    for module, name in found:
        imported = importlib.import_module(module)
        assert hasattr(imported, name) or importlib.util.find_spec(f"{module}.{name}"), name


@pytest.mark.parametrize("half_done", [False, True])
def test_an_environment_is_made_again_if_an_installation_was_cut_short(
    setup: ModuleType, half_done: bool
) -> None:
    venv = environment(setup)
    with pytest.raises(KeyboardInterrupt), setup._half_done():
        raise KeyboardInterrupt
    if not half_done:
        with setup._half_done():
            pass
    setup._forget_half_done(setup.Jobs())
    assert (venv / "package").exists() is not half_done


def test_an_environment_whose_python_is_gone_is_made_again(setup: ModuleType) -> None:
    venv = environment(setup)
    (venv / "bin" / "python").unlink()
    (venv / "bin" / "python").symlink_to("/nowhere/python")
    setup._forget_half_done(setup.Jobs())
    assert not venv.exists()


def test_what_nothing_uses_is_left_out(setup: ModuleType) -> None:
    packages = environment(setup) / "lib" / "python3.11" / "site-packages"
    kept = {
        "pyarrow/lib.so",
        "pyarrow/flight.py",
        "pyarrow/libarrow.so.2600",
        "MAVProxy/mavproxy.py",
    }
    left = {
        "pyarrow/include/a.h",
        "pyarrow/libarrow_flight.so.2600",
        "pyarrow/_s3fs.cpython-311.so",
    }
    for name in kept | left:
        (packages / name).parent.mkdir(parents=True, exist_ok=True)
        (packages / name).touch()
    setup._leave_out()
    files = (file for file in packages.rglob("*") if file.is_file())
    assert {str(file.relative_to(packages)) for file in files} == kept


def test_arrow_does_without_what_is_left_out() -> None:
    code = """
import sys
for name in ("_flight", "_s3fs"):
    sys.modules[f"pyarrow.{name}"] = None
import pyarrow.dataset, pyarrow.fs, pyarrow.ipc, pyarrow.parquet
import gcs.results.store, gcs.results.export
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()


def test_what_fails_is_one_line_with_its_log(setup: ModuleType) -> None:
    jobs = setup.Jobs()
    command = ["sh", "-c", "echo first; echo no such host; exit 3"]
    with pytest.raises(setup.FailedError) as problem:
        jobs.must(jobs.start("3 packages", "rest", command))
    assert str(problem.value) == (
        "3 packages: no such host. build/rest.log says more; "
        "run make again, which goes on from here"
    )
    assert (setup.BUILD / "rest.log").read_text() == "first\nno such host\n"


def test_what_is_killed_is_said(setup: ModuleType) -> None:
    jobs = setup.Jobs()
    job = jobs.start("3 packages", "rest", ["sh", "-c", "echo all is well; kill -9 $$"])
    with pytest.raises(setup.FailedError, match=r"^3 packages: SIGKILL ended it\. build/rest\.log"):
        jobs.must(job)


def test_a_full_disk_is_said(setup: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    def usage(_: Any) -> SimpleNamespace:
        return SimpleNamespace(free=20 * 2**20)

    monkeypatch.setattr(shutil, "disk_usage", usage)
    with pytest.raises(setup.FailedError, match="has 20 MB left, packages take 700: free some"):
        setup.main("fly")
    jobs = setup.Jobs()
    with pytest.raises(setup.FailedError, match="has 20 MB left: free some; run make again"):
        jobs.must(jobs.start("3 packages", "rest", ["false"]))


def test_two_do_not_install_at_once(setup: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    order = []

    def second() -> None:
        with setup._alone(setup.Jobs()):
            order.append("second")

    with setup._alone(setup.Jobs()):
        thread = threading.Thread(target=second)
        thread.start()
        while "waiting for another make" not in capsys.readouterr().out:
            time.sleep(0.01)
        order.append("first")
    thread.join()
    assert order == ["first", "second"]


def test_pips_settings_hold_for_uv(setup: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PIP_FIND_LINKS", "/wheels")
    monkeypatch.setenv("PIP_INDEX_URL", "https://example.org/simple")
    monkeypatch.setenv("UV_DEFAULT_INDEX", "https://example.org/uv")
    found = setup._environment()
    assert (found["UV_FIND_LINKS"], found["UV_DEFAULT_INDEX"]) == (
        "/wheels",
        "https://example.org/uv",
    )
