"""Where compiled code lies: a name for all that it depends on, and for nothing else."""

from pathlib import Path

import pytest

from mavlink_defs.runtime import cache_folder, sources

CODE = """from mavlink_defs.constant import FACTOR
def scaled(x):
    return FACTOR * x
"""
DESCRIBED = '''"""Numbers."""
from mavlink_defs.constant import FACTOR
"""Of all."""

# none is small
def scaled(
    x,
):
    """Return it larger."""
    return FACTOR * x  # by this
'''


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty package of ours, with an empty cache."""
    folder = tmp_path / "mavlink_defs"
    folder.mkdir()
    for module in (sources, cache_folder):
        monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(cache_folder, "FOLDER", tmp_path)
    cache_folder.code_digests.cache_clear()
    return folder


def folder_with(package: Path, code: str, constant: str) -> Path:
    """Where code lies of a file with what it imports."""
    (package / "scaled.py").write_text(code)
    (package / "constant.py").write_text(constant)
    sources.forget_sources()
    return cache_folder.folder_of(package / "scaled.py")


def test_what_is_written_for_people_does_not_count(package: Path) -> None:
    assert folder_with(package, DESCRIBED, "FACTOR = 2") == folder_with(package, CODE, "FACTOR=2 #")


@pytest.mark.parametrize(
    ("code", "constant"),
    [
        (CODE, "FACTOR = 3"),
        (CODE, "FACTOR = 2.0"),
        (CODE, "FACTOR = '2'"),
        (CODE.replace("FACTOR *", "FACTOR +"), "FACTOR = 2"),
        (CODE.replace("(x)", "(x, y=2)"), "FACTOR = 2"),
        (f"@compiled\n{CODE}", "FACTOR = 2"),
        (f"{CODE}    (", "FACTOR = 2"),
    ],
)
def test_all_else_does(package: Path, code: str, constant: str) -> None:
    assert folder_with(package, code, constant) != folder_with(package, CODE, "FACTOR = 2")


def test_of_other_people_s_files_lines_count(package: Path, tmp_path: Path) -> None:
    """Their errors name them."""
    theirs = tmp_path / "law.py"
    theirs.write_text(CODE)
    before = cache_folder.folder_of(theirs)
    theirs.write_text(f"\n{CODE}")
    sources.forget_sources()
    assert cache_folder.folder_of(theirs) != before


def test_files_are_parsed_once(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """For all processes: a second for all that is compiled."""
    before = folder_with(package, CODE, "FACTOR = 2")
    sources.forget_sources()
    cache_folder.code_digests.cache_clear()
    monkeypatch.delattr(cache_folder, "_bare")
    assert cache_folder.folder_of(package / "scaled.py") == before
