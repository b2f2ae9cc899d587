"""What the build of a wheel asks for before it compiles for minutes."""

import importlib.util
import sysconfig
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def hook() -> Any:
    """The build hook of this project."""
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    module: Any = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.DialectHook(str(ROOT), {}, None, None, "", "wheel")


def test_machine_code_needs_the_headers_of_python(
    hook: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A slim system has Python without them; the compiler misses them after minutes."""
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(tmp_path))
    monkeypatch.setenv("FTC_SITL_MACHINE_CODE", "1")
    with pytest.raises(SystemExit, match=rf"{tmp_path} has no Python.h: install them, such as by"):
        hook.dependencies()
    (tmp_path / "Python.h").touch()
    assert "setuptools" in hook.dependencies()


def test_another_wheel_needs_no_headers(
    hook: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sysconfig, "get_path", lambda name: str(tmp_path))
    monkeypatch.delenv("FTC_SITL_MACHINE_CODE", raising=False)
    assert hook.dependencies() == []
