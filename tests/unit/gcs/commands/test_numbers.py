"""Every number of the command line is finite: NaN and infinity are refused before anything runs."""

import sys
from collections.abc import Iterator
from itertools import cycle
from typing import Any

import pytest

from gcs.commands.cli import main, whole_command


def commands(command: Any, *names: str) -> Iterator[tuple[tuple[str, ...], Any]]:
    yield names, command
    for name, inner in getattr(command, "commands", {}).items():
        yield from commands(inner, *names, name)


def is_number(parameter: Any) -> bool:
    return parameter.type_descriptor.annotation in {float, int, list[float], list[int]}


NUMBERS = [
    (names, command, parameter)
    for names, command in commands(whole_command())
    for parameter in command.params
    if is_number(parameter)
]


def given(command: Any, number: Any, value: str) -> Iterator[str]:
    """Yield arguments that are right but for one number."""
    if number.param_type_name == "option":
        yield f"{number.opts[-1]}={value}"
    for argument in command.params:
        if argument is number and argument.param_type_name == "argument":
            yield value
        elif argument.param_type_name == "argument":
            choices = argument.type_descriptor.choices
            yield str(choices[0]) if choices else "1"


def test_what_is_no_finite_number_is_refused_with_what_is_expected(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    subtests: pytest.Subtests,
) -> None:
    assert len(NUMBERS) > 100
    for (names, command, number), value in zip(NUMBERS, cycle(("nan", "inf")), strict=False):
        with subtests.test(f"{' '.join(names)} {number.opts[0]}", value=value):
            whole = number.type_descriptor.annotation in {int, list[int]}
            monkeypatch.setattr(sys, "argv", ["gcs", *names, *given(command, number, value)])
            with pytest.raises(SystemExit) as ended:
                main()
            shown = capsys.readouterr()
            assert (ended.value.code, shown.out) == (2, "")
            name = number.opts[-1] if number.param_type_name == "option" else ""
            expected = "a whole number" if whole else "a finite number"
            assert f"{name}: expected {expected}" in shown.err
            assert f"got '{value}'" in shown.err
            for bound in (number.min, number.max):
                assert bound is None or whole or f"{bound:g}" in shown.err
