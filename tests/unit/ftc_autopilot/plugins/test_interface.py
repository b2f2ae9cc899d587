"""The C headers against the records and tuples that compiled code uses."""

import math
import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from own_laws import COMPILER, HEADERS

from ftc_autopilot.control.controller import CONTROLLER, PARAMETERS
from ftc_autopilot.control.laws.plugin import LAW, LAW_INPUT, LAW_OUTPUT, LawInput
from ftc_autopilot.control.triggers.plugin import TRIGGER, TRIGGER_INPUT, TRIGGER_OUTPUT
from ftc_autopilot.guidance.laws.plugin import GUIDANCE, GUIDANCE_INPUT, GUIDANCE_OUTPUT
from ftc_autopilot.plugins.functions import ABI
from ftc_autopilot.plugins.memory import bytes_of, layout_of, tuple_at
from sitl_plant.airframe.aircraft import AIRCRAFT

STRUCTS = {
    "ftc_law_input": LAW_INPUT,
    "ftc_law_output": LAW_OUTPUT,
    "ftc_aircraft": AIRCRAFT,
    "ftc_trigger_input": TRIGGER_INPUT,
    "ftc_trigger_output": TRIGGER_OUTPUT,
    "ftc_guidance_input": GUIDANCE_INPUT,
    "ftc_guidance_output": GUIDANCE_OUTPUT,
}
KNOWN = {
    "ftc_law_input": LAW.known,
    "ftc_trigger_input": TRIGGER.known,
    "ftc_guidance_input": GUIDANCE.known,
}
"""Bytes of a record that its header declares, if not all."""
IN_C = {"thresholds.": "", "seen.motion": "seen"}
"""Names of Python that a header has not."""


def in_c(path: str) -> str:
    """Name of a member in C."""
    for name, other in IN_C.items():
        path = path.replace(name, other)
    return path


def members(dtype: np.dtype, at: int = 0, prefix: str = "") -> list[tuple[str, int, int, str]]:
    """Path, offset, size and kind of each member of a record, those of inner records included."""
    found = []
    for name in dtype.names or ():
        inner, offset = dict(dtype.fields or {})[name][:2]
        if inner.names:
            found += members(inner, at + offset, f"{prefix}{name}.")
        else:
            found.append((f"{prefix}{name}", at + offset, inner.itemsize, inner.base.kind))
    return found


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_the_headers_declare_the_records_of_compiled_code(tmp_path: Path) -> None:
    lines, expected = [], []
    for name, dtype in STRUCTS.items():
        lines.append(f'printf("%zu\\n", sizeof(struct {name}));')
        known = KNOWN.get(name, dtype.itemsize)
        expected.append(str(known))
        for python, offset, size, kind in members(dtype):
            path = in_c(python)
            if offset >= known:
                continue
            one = f"((struct {name} *)0)->{path}"
            is_int = f"_Generic(*({'int64_t' if kind == 'i' else 'double'} *)&{one}, default: 1)"
            lines.append(
                f'printf("{name}.{path} %zu %zu %d\\n", offsetof(struct {name}, {path}), '
                f"sizeof({one}), {is_int});"
            )
            expected.append(f"{name}.{path} {offset} {size} 1")
    lines.append('printf("%d\\n", FTC_LAW_ABI);')
    expected.append(str(ABI))
    body = "\n".join(lines)
    (tmp_path / "sizes.c").write_text(
        "#include <stddef.h>\n#include <stdio.h>\n"
        '#include "ftc_trigger.h"\n#include "ftc_guidance.h"\n'
        f"int main(void) {{\n{body}\nreturn 0;\n}}\n"
    )
    command = [str(COMPILER), f"-I{HEADERS}", "sizes.c", "-o", "sizes"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=600)
    printed = subprocess.run([tmp_path / "sizes"], capture_output=True, text=True, check=True)
    assert printed.stdout.splitlines() == expected


def test_the_header_can_be_used_from_cpp(tmp_path: Path) -> None:
    if COMPILER is None:
        pytest.skip("no C compiler")
    (tmp_path / "law.cpp").write_text('#include "ftc_trigger.h"\nint main() { return 0; }\n')
    command = [COMPILER, "-x", "c++", f"-I{HEADERS}", "-fsyntax-only", "-Wall", "law.cpp"]
    done = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, timeout=600)
    if b"cc1plus" in done.stderr:
        pytest.skip("no C++ compiler")
    assert done.returncode == 0, done.stderr


@given(st.binary(min_size=LAW_INPUT.itemsize, max_size=LAW_INPUT.itemsize))
def test_a_tuple_in_memory_is_the_record(memory: bytes) -> None:
    value = tuple_at(LawInput, memory)
    assert bytes_of(value) == memory
    record = np.frombuffer(memory, layout_of(LawInput))[0]
    given_c = np.array(value.motion.air.C).tobytes()
    assert given_c == record["motion"]["air"]["C"].tobytes()
    assert struct.pack("=d", value.seen.motion.V_dot) == record["seen"]["motion"]["V_dot"].tobytes()
    assert value.after_gap == record["after_gap"]
    assert math.isnan(value.dt) == np.isnan(record["dt"])


def test_what_is_no_tuple_of_numbers_has_no_memory() -> None:
    for kind in (str, np.ndarray, tuple[float, int], list[float]):
        with pytest.raises(TypeError, match="no number"):
            layout_of(kind)


@pytest.mark.parametrize("dtype", [PARAMETERS, CONTROLLER])
def test_the_area_of_a_plugin_is_aligned_in_every_record_of_an_array(dtype: Any) -> None:
    records = np.zeros(3, dtype)
    for name in ("plugin", "trigger"):
        part = records[name] if name == "plugin" else records[name]["plugin"]
        numbers = part["own"]["numbers"]
        assert numbers.ctypes.data % 8 == 0
    assert dtype.itemsize % 8 == 0
