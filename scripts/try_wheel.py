"""Fly a wheel with machine code where no compiler is: ``scripts/try_wheel.py WHEEL SCRATCH``.

The environment has the packages of `.venv` but numba and llvmlite. Flights have the same bits as
compiled here, and as in plain Python.
"""

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

from mavlink_defs.runtime.ahead_of_time import GLIBC

ROOT = Path(__file__).parents[1]
COMPILER = ("numba", "llvmlite")
FLIGHTS = (
    ("paper/scenario1", "--set", "duration_s=4"),
    ("paper/scenario1", "--with", "tube", "--set", "duration_s=2"),
    ("paper/scenario1", "--with", "surviving", "--set", "duration_s=2"),
    ("missions/hexagon", "--with", "estimated", "--set", "duration_s=2"),
)
WRONG = """
import importlib, inspect, sys
import numpy as np
from mavlink_defs.runtime.jit import CompilerMissing
from mavlink_defs.runtime.prebuilt import content
record = np.zeros(2, [("a", "f8")])
values = [None, "text", 1j, (), (1,), (1.0, 2.0), [1.0], np.float32(1.0), np.zeros(3, "f4")]
values += [np.zeros((2, 2))[:, 0], np.zeros(2, "i8"), record, record[0], np.zeros((1, 1, 1))]
refused = 0
for name in content().functions:
    module, function = name.split(":")
    call = getattr(importlib.import_module(module), function)
    for value in values:
        for arguments in ((value,) * len(inspect.signature(call).parameters), (value,) * 20):
            try:
                call(*arguments)
            except (CompilerMissing, TypeError):
                refused += 1
print(refused, "calls with other types refused")
sys.exit(bool({"numba", "llvmlite"} & set(sys.modules)))
"""
LAW = """
from ftc_autopilot.control.step import ALL, Command
from ftc_autopilot.control.laws.base import LawParameters
from mavlink_defs.runtime.jit import compiled
class Mine(LawParameters):
    @staticmethod
    @compiled
    def step(now, aircraft, gains, state):
        return Command((0.0, 0.0, 0.0), 10.0, ALL)
"""
TABLES = ("events.arrows", "trajectory.arrows")
MOST_BYTES = 5_000_000


def main(wheel: Path, scratch: Path) -> None:
    """Try all; the first thing that is wrong ends the program."""
    module = machine_code(wheel, scratch)
    check_module(module, wheel)
    programs = installed(wheel, scratch / "installed")
    here = Path(sys.executable).parent
    for number, flight in enumerate(FLIGHTS):
        compiled = fly(here, flight, scratch / f"compiled{number}", PYTHONPATH=str(ROOT))
        made = fly(programs, flight, scratch / f"made{number}")
        check_alike(compiled, made)
        print(f"the same bits: gcs fly {' '.join(flight)}", flush=True)
    short = (*FLIGHTS[0][:2], "duration_s=0.05")
    made = fly(programs, short, scratch / "made")
    plain = fly(programs, short, scratch / "plain", NUMBA_DISABLE_JIT="1")
    check_alike(made, plain)
    print("plain Python flies the same")
    check(run(scratch, programs / "python", "-c", WRONG) == 0, "calls with other types")
    check_edited(programs, scratch)
    check_compiled_law(programs, scratch)


def run(folder: Path, *command: str | Path) -> int:
    """Run a program in a folder; return its status."""
    return subprocess.run(command, check=False, env=environment(), cwd=folder).returncode


def environment(**variables: str) -> dict[str, str]:
    """Return the environment of programs that find no other package than the installed one."""
    left = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return left | {"NUMBA_DISABLE_JIT": "0"} | variables


def refusal(scratch: Path, *command: str | Path) -> str:
    """Run a command that is to end with one line of an error; return that."""
    env = environment()
    done = subprocess.run(
        command, check=False, capture_output=True, text=True, cwd=scratch, env=env
    )
    check(done.returncode == 2 and "Traceback" not in done.stderr, done.stderr)
    return done.stderr.splitlines()[-1]


def machine_code(wheel: Path, scratch: Path) -> Path:
    """Take the machine code out of a wheel."""
    with zipfile.ZipFile(wheel) as file:
        (name,) = [one for one in file.namelist() if "runtime/machine_code" in one]
        return Path(file.extract(name, scratch / "content"))


def check_module(module: Path, wheel: Path) -> None:
    """Check size, tag and the symbols of libraries that the machine code needs."""
    listed = subprocess.run(["objdump", "-T", module], check=True, capture_output=True, text=True)
    versions = set(re.findall(r"GLIBC_([\d.]+)", listed.stdout))
    newest = max(versions, key=numbers)
    size, needed = module.stat().st_size, re.findall(r"\*UND\*.*(?:numba|NRT).*", listed.stdout)
    print(f"{module.name}: {size} bytes, {wheel.stat().st_size} in a wheel, glibc {newest}")
    check(size <= MOST_BYTES and not needed, size, needed)
    if "manylinux" in wheel.name:
        check(numbers(newest) <= numbers(GLIBC), newest)


def numbers(version: str) -> list[int]:
    """Return the numbers of a version."""
    return [int(part) for part in version.split(".")]


def installed(wheel: Path, folder: Path) -> Path:
    """Install the wheel where all its dependencies are, and no compiler; return the programs."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    pip = ("-m", "pip", "--python", folder / "bin" / "python", "install", "--quiet")
    options = ("--disable-pip-version-check", "--no-index", "--no-deps")
    subprocess.run([sys.executable, *pip, *options, wheel], check=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    for path in sys.path:
        if not path.endswith("-packages"):
            continue
        for package in Path(path).iterdir():
            skipped = package.suffix == ".pth" or package.name.startswith("__editable")
            if not skipped and not package.name.startswith((*COMPILER, "ftc_sitl")):
                target = packages / package.name
                if not target.exists():
                    target.symlink_to(package)
    return folder / "bin"


def fly(programs: Path, flight: tuple[str, ...], out: Path, **variables: str) -> Path:
    """Fly over UDP and in an empty folder; return the run folder."""
    out.parent.mkdir(exist_ok=True)
    command = (programs / "gcs", "fly", *flight, "--free-ports", "--quiet", "--no-figures")
    env = environment(**variables)
    done = subprocess.run([*command, "--out", out], cwd=out.parent, env=env, check=False)
    check(done.returncode == 0, flight)
    return out


def check_alike(a: Path, b: Path) -> None:
    """Check that two flights have the same bits."""
    for table in TABLES:
        check((a / table).read_bytes() == (b / table).read_bytes(), a, b, table)


def check_edited(programs: Path, scratch: Path) -> None:
    """Check that an edited law is missed, with one message that says how to compile it."""
    (law,) = programs.parent.glob(
        "lib/python*/site-packages/ftc_autopilot/control/laws/tube/law.py"
    )
    before = law.read_text()
    law.write_text(f"{before}\n# edited\n")
    out = ("--quiet", "--out", scratch / "edited")
    said = refusal(scratch, programs / "gcs", "fly", "paper/scenario1", "--free-ports", *out)
    law.write_text(before)
    check("tube/law.py" in said and "pip install 'numba" in said, said)
    print(said)


def check_compiled_law(programs: Path, scratch: Path) -> None:
    """Check that a law of compiled Python asks for the compiler, in one line."""
    (scratch / "mine.py").write_text(LAW)
    chosen = ("--set", "controller.kind=mine.py:Mine", "--quiet", "--out", scratch / "mine")
    said = refusal(scratch, programs / "gcs", "fly", "paper/scenario1", "--free-ports", *chosen)
    check("compiled Python, and the compiler" in said, said)
    print(said)


def check(fits: object, *found: object) -> None:
    """End the program unless something fits."""
    if not fits:
        sys.exit(f"wrong: {' '.join(map(str, found))}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
