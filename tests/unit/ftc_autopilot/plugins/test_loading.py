"""What is wrong with a plug-in is said in one line with its file and line; changed code counts."""

import os
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest
from own_laws import COMPILED, COMPILER, HEAD, LIBRARY, C, build, write_law, write_trigger

from ftc_autopilot.control.laws import law_of
from ftc_autopilot.plugins import loading
from ftc_autopilot.plugins.loading import plugin_of
from gcs.console.errors import BadInput
from gcs.scenario.model import Scenario, load_scenario, scenario_of, scenario_tree
from gcs.scenario.plugins import prepare_plugins
from mavlink_defs.config.models import ConfigError
from mavlink_defs.runtime.foreign import PluginError

BASE = "paper/scenario1"
IMPORTS = """import numpy as np
from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.step import ALL, Command
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import compiled


"""


def scenario(folder: Path, **changes: Any) -> Scenario:
    return scenario_of(folder / "s.yaml", scenario_tree(BASE) | changes)


def prepared(folder: Path, controller: dict[str, Any]) -> None:
    flown = scenario(folder, controller=controller)
    prepare_plugins(flown)


def refusal(folder: Path, text: str | None, name: str = "Mine", **keys: Any) -> str:
    """The one line with which a law in a file is refused, its folder as DIR."""
    if text is not None:
        (folder / "mine.py").write_text(text)
    with pytest.raises((ConfigError, BadInput)) as caught:
        prepared(folder, {"kind": f"mine.py:{name}", **keys})
    text = str(caught.value)
    assert "\n" not in text
    return text.replace(str(folder), "DIR")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (None, "DIR/s.yaml: controller.kind: DIR/mine.py: No such file or directory"),
        ("class Other: pass\n", "DIR/mine.py: has no class 'Mine'"),
        ("class Mine: pass\n", "DIR/mine.py: Mine is a class: expected a subclass of ftc_autop"),
        ("Mine = 3\n", "DIR/mine.py: Mine is a int: expected a subclass of"),
        ("\n\nclass Mine(\n", "DIR/mine.py:3: SyntaxError: '(' was never closed, raised when"),
        ("import math\n\nx = 1 / 0\n", "DIR/mine.py:3: ZeroDivisionError: division by zero, rai"),
        ("import nothing_of_this_name\n", "DIR/mine.py:1: ModuleNotFoundError: No module named"),
        (IMPORTS + "class Mine(LawParameters):\n    gain = 3\n", "DIR/mine.py:8: PydanticUserErr"),
        (
            IMPORTS + "class Mine(LawParameters):\n    '''Nothing.'''\n",
            "DIR/mine.py: Mine has neither a function `step` nor LIBRARY",
        ),
        (
            IMPORTS + "class Mine(LawParameters):\n    def step(self, now): pass\n",
            "DIR/mine.py:9: Mine.step: expected a @staticmethod (now, aircraft, gains, state)",
        ),
        (
            IMPORTS
            + "class Mine(LawParameters):\n    @staticmethod\n    def step(now, aircraft): pass\n",
            "DIR/mine.py:9: Mine.step has 2 arguments, expected (now, aircraft, gains, state)",
        ),
        (
            IMPORTS + "class Mine(LawParameters):\n    STATE = np.dtype([('x', 'f8', 4000)])\n",
            "DIR/mine.py: Mine has a STATE of 32000 bytes, expected at most 24576",
        ),
        (
            IMPORTS
            + "class Mine(LawParameters):\n    names: list[str] = []\n"
            + "    @staticmethod\n    def step(now, aircraft, gains, state): pass\n",
            "DIR/mine.py: Mine: a compiled law cannot have a parameter of type list[str]",
        ),
        (
            IMPORTS
            + "class Mine(LawParameters):\n    @staticmethod\n    @compiled\n"
            + "    def step(now, aircraft, gains, state):\n"
            + "        x = gains['nothing']\n        return Command((x, x, x), x, ALL)\n",
            "DIR/mine.py:12: Mine.step cannot be compiled: ",
        ),
    ],
)
def test_a_law_that_cannot_be_used_is_refused_in_a_line(
    tmp_path: Path, text: str | None, expected: str
) -> None:
    assert expected in refusal(tmp_path, text)


def test_the_keys_of_a_law_are_checked_as_ours_are(tmp_path: Path) -> None:
    write_law(tmp_path, "plain")
    text = refusal(tmp_path, None, attitude_gain=-1.0)
    assert text.endswith("controller.attitude_gain: expected > 0, got -1.0")
    text = refusal(tmp_path, None, attitude_gian=1.0)
    assert text.endswith("controller.attitude_gian: unknown key; did you mean 'attitude_gain'?")
    text = refusal(tmp_path, None, limit_deg="x")
    assert text.endswith("controller.limit_deg: expected a number in deg, got 'x'")


def test_an_unknown_name_is_told_that_a_file_can_be_given(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"'tube', 'FILE.py:CLASS', got 'tubes'"):
        scenario(tmp_path, controller={"kind": "tubes"})
    with pytest.raises(ConfigError, match=r"'scaled', 'FILE.py:CLASS', got 'scale'"):
        scenario(tmp_path, trigger={"mode": "scale"})


def test_the_line_of_the_scenario_is_named(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text(f"extends: {BASE}\n\ncontroller:\n  kind: no.py:Law\n")
    with pytest.raises(ConfigError) as caught:
        load_scenario(tmp_path / "s.yaml")
    assert f"{tmp_path}/s.yaml:4: controller.kind: {tmp_path}/no.py: No such file" in str(
        caught.value
    )


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (
            ("FTC_LAW(", "#undef FTC_LAW_ABI\n#define FTC_LAW_ABI 7\nFTC_LAW("),
            "for version 7 of ftc",
        ),
        (("rate_gain_s,", "rate_gain_s, more,"), "its parameters have 40 bytes, Mine has 32"),
        (("int64_t steps;", "int64_t steps, more;"), "its state have 24 bytes, Mine has 16"),
        (
            ("FTC_LAW(struct parameters, sizeof(struct state), 0, step);", ""),
            "exports no struct 'ftc_law'",
        ),
        ((", 0, step)", ", 0, 0)"), "`step` in 'ftc_law' is no function"),
    ],
)
def test_a_library_for_another_interface_is_refused(
    tmp_path: Path, change: tuple[str, str], expected: str
) -> None:
    text = C.replace(*change)
    assert text != C
    build(tmp_path, text.replace("static int32_t step", "int32_t step"))
    line = refusal(tmp_path, LIBRARY)
    assert f"DIR/mine.so: {expected}" in line or f"DIR/mine.so: was built {expected}" in line


def test_a_library_that_is_not_there_or_none_is_refused(tmp_path: Path) -> None:
    assert "DIR/mine.so: " in refusal(tmp_path, LIBRARY)
    assert "No such file or directory" in refusal(tmp_path, LIBRARY)
    (tmp_path / "mine.so").write_bytes(b"no library")
    assert "DIR/mine.so: cannot be loaded" in refusal(tmp_path, LIBRARY)


def test_an_entry_point_with_a_name_of_ours_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    point = EntryPoint("pid", "their.laws:Pid", loading.LAWS)
    monkeypatch.setattr(loading, "registered", lambda group: {"pid": point})
    with pytest.raises(ConfigError) as caught:
        scenario(tmp_path, controller={"kind": "pid"})
    assert "registers 'pid' (their.laws:Pid) in ftc_sitl.laws, which is a name" in str(caught.value)
    scenario(tmp_path, controller={"kind": "proposed"})


def test_a_digest_changes_with_the_law_and_with_what_it_imports(tmp_path: Path) -> None:
    package = tmp_path / "theirs"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "gains.py").write_text("GAIN = 1.0\n")
    (package / "law.py").write_text("from .gains import GAIN\n" + COMPILED)
    (tmp_path / "other.py").write_text("")
    script = (
        "from ftc_autopilot.plugins import loading as l\n"
        "from ftc_autopilot.control.laws.base import LawParameters\n"
        "from importlib.metadata import EntryPoint\n"
        "l.registered = lambda g: {'x': EntryPoint('x', 'theirs.law:Mine', g)}\n"
        "law = l.load_class('x', l.LAWS, LawParameters)\n"
        "print(l.plugin_of(law).digest, [p.name for p in l.plugin_of(law).sources])\n"
    )

    def digest() -> str:
        env = os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{os.getcwd()}"}
        command = [sys.executable, "-c", script]
        done = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
        return done.stdout

    first = digest()
    assert "['gains.py', 'law.py']" in first
    (tmp_path / "other.py").write_text("changed = True\n")
    assert digest() == first
    (package / "gains.py").write_text("GAIN = 2.0\n")
    assert digest() != first


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_a_digest_changes_with_the_library(tmp_path: Path) -> None:
    digests = []
    for folder, source in ((tmp_path / "a", C), (tmp_path / "b", C.replace("9.0", "8.0"))):
        folder.mkdir()
        (folder / "mine.py").write_text(LIBRARY)
        build(folder, source)
        found = plugin_of(law_of(f"{folder}/mine.py:Mine"))
        assert found is not None
        digests.append(found.digest)
    assert digests[0] != digests[1]


def test_other_code_than_a_scenario_was_read_with_is_refused(tmp_path: Path) -> None:
    name = write_law(tmp_path, "plain")
    trigger = write_trigger(tmp_path / "t", "plain")
    flown = scenario(tmp_path, controller={"kind": name}, trigger={"mode": trigger})
    assert set(flown.plugins) == {name, trigger}
    assert flown.autopilot_config(1).plugins == flown.plugins
    tree = flown.model_dump()
    assert Scenario.model_validate(tree) == flown
    (tmp_path / "mine.py").write_text(HEAD + LIBRARY.replace(HEAD, "") + "\n# changed\n")
    (tmp_path / "mine.py").write_text(COMPILED)
    with pytest.raises(ConfigError) as caught:
        scenario_of(tmp_path / "s.yaml", tree)
    old = flown.plugins[name]
    assert f"plugins.{name}: expected code with digest {old}, it has " in str(caught.value)


def test_a_law_that_is_loaded_twice_is_one_class(tmp_path: Path) -> None:
    name = write_law(tmp_path, "compiled")
    assert law_of(name) is law_of(name)
    with pytest.raises(PluginError, match="has no class 'Missing'"):
        law_of(name.replace(":Mine", ":Missing"))
