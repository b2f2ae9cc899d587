"""One law written three times, and one trigger: files that a test writes into a folder."""

import shutil
import subprocess
from pathlib import Path

from ftc_autopilot import plugins

HEADERS = Path(plugins.__file__).parent
COMPILER = shutil.which("cc")

HEAD = '''
"""Surfaces proportional to attitude error and body rate, thrust to the speed error's integral."""

from typing import ClassVar

import numpy as np

from ftc_autopilot.control.laws.base import LawParameters
from ftc_autopilot.control.step import ALL, Command, Step
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import compiled


class Gains(LawParameters):
    STATE: ClassVar[np.dtype] = np.dtype([("integral", "f8"), ("steps", "i8")])

    attitude_gain: float = quantity("", gt=0.0, default=2.0, doc="Deflection per error.")
    rate_gain_s: float = quantity("s", ge=0.0, default=0.5, doc="Deflection per body rate.")
    speed_gain_n_s_m: float = quantity("N s/m", gt=0.0, default=300.0, doc="Thrust by error.")
    limit_deg: float = quantity("deg", gt=0.0, default=20.0, doc="Largest deflection.")


def law(now, aircraft, gains, state):
    e, omega = now.errors.e, now.motion.omega
    k, d, most = gains["attitude_gain"], gains["rate_gain_s"], gains["limit_rad"]
    state["integral"] += now.dt * now.errors.V_tilde
    state["steps"] += 1
    a = min(max(k * e[0] + d * omega[0], -most), most)
    b = min(max(k * e[1] + d * omega[1], -most), most)
    c = min(max(k * e[2] + d * omega[2], -most), most)
    thrust = 9.0 * aircraft["m"] - gains["speed_gain_n_s_m"] * (
        now.errors.V_tilde + 0.5 * state["integral"]
    )
    return Command((a, b, c), thrust, ALL)
'''

COMPILED = (
    HEAD
    + '''
fast = compiled(law)


class Mine(Gains):
    """Compiled Python."""

    @staticmethod
    @compiled
    def step(now: Step, aircraft: np.void, gains: np.void, state: np.void) -> Command:
        """Evaluate the law."""
        return fast(now, aircraft, gains, state)
'''
)

PLAIN = (
    HEAD
    + '''

class Mine(Gains):
    """Plain Python."""

    @staticmethod
    def step(now: Step, aircraft: np.void, gains: np.void, state: np.void) -> Command:
        """Evaluate the law."""
        return law(now, aircraft, gains, state)
'''
)

LIBRARY = (
    HEAD
    + '''

class Mine(Gains):
    """A shared library."""

    LIBRARY = "mine.so"
'''
)

C = """
#include "ftc_law.h"

struct parameters { double attitude_gain, rate_gain_s, speed_gain_n_s_m, limit_rad; };
struct state { double integral; int64_t steps; };

static double clamp(double x, double most) {
    x = x > -most ? x : -most;
    return x < most ? x : most;
}

static int32_t step(const struct ftc_law_input *in, struct ftc_law_output *out,
                    const void *parameters, void *memory, const struct ftc_aircraft *aircraft,
                    void *reserved) {
    const struct parameters *p = parameters;
    struct state *s = memory;
    (void)reserved;
    s->integral += in->dt * in->errors.V_tilde;
    s->steps += 1;
    for (int i = 0; i < 3; i++)
        out->delta[i] =
            clamp(p->attitude_gain * in->errors.e[i] + p->rate_gain_s * in->motion.omega[i],
                  p->limit_rad);
    out->thrust =
        9.0 * aircraft->m - p->speed_gain_n_s_m * (in->errors.V_tilde + 0.5 * s->integral);
    return 0;
}

FTC_LAW(struct parameters, sizeof(struct state), 0, step);
"""


def build(folder: Path, source: str, name: str = "mine") -> Path:
    """Build a shared library in a folder."""
    assert COMPILER is not None
    (folder / f"{name}.c").write_text(source)
    target = folder / f"{name}.so"
    options = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-ffp-contract=off"]
    command = [
        COMPILER,
        *options,
        "-shared",
        "-fPIC",
        f"-I{HEADERS}",
        f"{name}.c",
        "-o",
        target.name,
    ]
    subprocess.run(command, cwd=folder, check=True, timeout=600)
    return target


TRIGGER_HEAD = """
from typing import ClassVar

import numpy as np

from ftc_autopilot.control.triggers.base import Candidates, TriggerParameters
from mavlink_defs.config.quantity import whole
from mavlink_defs.runtime.jit import compiled


class Nth(TriggerParameters):
    STATE: ClassVar[np.dtype] = np.dtype([("steps", "i8")])
    nth: int = whole("", ge=1, default=7, doc="Steps between two messages.")


def nth(now, parameters, state):
    state["steps"] += 1
    moved = abs(now.commanded[0] - now.held[0]) >= now.absolute[0]
    return 15 if now.first or (moved and state["steps"] % parameters["nth"] == 1) else 0
"""

TRIGGERS = {
    "compiled": TRIGGER_HEAD
    + """

fast = compiled(nth)


class Mine(Nth):
    @staticmethod
    @compiled
    def step(now, parameters, state):
        return fast(now, parameters, state)
""",
    "plain": TRIGGER_HEAD
    + """

class Mine(Nth):
    step = staticmethod(nth)
""",
    "library": TRIGGER_HEAD
    + """

class Mine(Nth):
    LIBRARY = "mine.so"
""",
}

TRIGGER_C = """
#include <math.h>
#include "ftc_trigger.h"

struct parameters { int64_t nth; };
struct state { int64_t steps; };

static int32_t step(const struct ftc_trigger_input *in, struct ftc_trigger_output *out,
                    const void *parameters, void *memory) {
    const struct parameters *p = parameters;
    struct state *s = memory;
    s->steps += 1;
    int moved = fabs(in->commanded[0] - in->held[0]) >= in->absolute[0];
    if (in->first || (moved && s->steps % p->nth == 1))
        out->channels = FTC_ALL_CHANNELS;
    return 0;
}

FTC_TRIGGER(struct parameters, sizeof(struct state), 0, step);
"""

LAWS = {"compiled": COMPILED, "plain": PLAIN, "library": LIBRARY}


def write_law(folder: Path, way: str) -> str:
    """Write the law, in one of the ways of `LAWS`; return its name."""
    folder.mkdir(exist_ok=True)
    (folder / "mine.py").write_text(LAWS[way])
    if way == "library":
        build(folder, C)
    return f"{folder / 'mine.py'}:Mine"


def write_trigger(folder: Path, way: str) -> str:
    """Write the trigger, in one of the ways of `TRIGGERS`; return its name."""
    folder.mkdir(exist_ok=True)
    (folder / "mine.py").write_text(TRIGGERS[way])
    if way == "library":
        build(folder, TRIGGER_C)
    return f"{folder / 'mine.py'}:Mine"


GUIDANCE_HEAD = """
from typing import ClassVar

import numpy as np

from ftc_autopilot.guidance.laws.base import GuidanceParameters, Situation
from mavlink_defs.config.quantity import quantity
from mavlink_defs.runtime.jit import compiled


class Faster(GuidanceParameters):
    STATE: ClassVar[np.dtype] = np.dtype([("updates", "i8")])
    faster_m_s: float = quantity("m/s", default=2.0, doc="Added to the airspeed.")
    cross_track_1_s: float = quantity("1/s", gt=0.0, default=0.8, doc="As of path.")


def faster(now, path, s, coordination, aircraft, limits, gains, state, command):
    state["updates"] += 1
    most = limits["airspeed_max_m_s"] + 0.0 * path["height"][0]
    share = min(state["updates"] * 0.1, 1.0)
    airspeed = min(command[0] + share * gains["faster_m_s"], most)
    return airspeed, command[1], command[2] + 1e-9 * s * now.dt, command[3]
"""

GUIDANCE = {
    "compiled": GUIDANCE_HEAD
    + """

fast = compiled(faster)


class Mine(Faster):
    @staticmethod
    @compiled
    def step(now, path, s, coordination, aircraft, limits, gains, state, command):
        return fast(now, path, s, coordination, aircraft, limits, gains, state, command)
""",
    "of three arguments": GUIDANCE_HEAD
    + """

class Mine(Faster):
    @staticmethod
    @compiled
    def step(now, gains, state):
        state["updates"] += 1
        share = min(state["updates"] * 0.1, 1.0)
        airspeed = min(now.command[0] + share * gains["faster_m_s"], 60.0)
        return airspeed, now.command[1], now.command[2] + 1e-9 * now.s * now.dt, now.command[3]
""",
    "plain": GUIDANCE_HEAD
    + """

class Mine(Faster):
    step = staticmethod(faster)
""",
    "library": GUIDANCE_HEAD
    + """

class Mine(Faster):
    LIBRARY = "mine.so"
""",
}

GUIDANCE_C = """
#include <math.h>
#include "ftc_guidance.h"

struct parameters { double faster_m_s, cross_track_1_s; };
struct state { int64_t updates; };

static int32_t step(const struct ftc_guidance_input *in, struct ftc_guidance_output *out,
                    const void *parameters, void *memory, const struct ftc_aircraft *aircraft,
                    const void *reserved, const void *reserved_too) {
    const struct parameters *p = parameters;
    struct state *s = memory;
    (void)aircraft, (void)reserved, (void)reserved_too;
    s->updates += 1;
    out->command[0] = fmin(in->command[0] + fmin(s->updates * 0.1, 1.0) * p->faster_m_s, 60.0);
    out->command[2] = in->command[2] + 1e-9 * in->s * in->dt;
    return 0;
}

FTC_GUIDANCE(struct parameters, sizeof(struct state), 0, step);
"""


def write_guidance(folder: Path, way: str) -> str:
    """Write the guidance law, in one of the ways of `GUIDANCE`; return its name."""
    folder.mkdir(exist_ok=True)
    (folder / "mine.py").write_text(GUIDANCE[way])
    if way == "library":
        build(folder, GUIDANCE_C)
    return f"{folder / 'mine.py'}:Mine"
