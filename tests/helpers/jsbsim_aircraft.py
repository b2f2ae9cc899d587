"""An aircraft of ours as JSBSim reads one: the same mass and aerodynamics, in its own words."""

import math
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

import pytest

from sitl_plant.airframe.config import Aircraft

needs_jsbsim = pytest.mark.skipif(
    find_spec("jsbsim") is None,
    reason="jsbsim is missing: pip install jsbsim",
)

AILERON, ELEVATOR, RUDDER = (
    f"fcs/{name}-pos-rad" for name in ("left-aileron", "elevator", "rudder")
)
ALPHA, BETA = "aero/alpha-rad", "aero/beta-rad"
P, Q, R = (f"ftc/{axis}-hat" for axis in "pqr")
ATTACHED, PLATE_LIFT, PLATE_DRAG = (
    f"ftc/{name}" for name in ("attached", "plate-lift", "plate-drag")
)
KG_M2_PER_SLUG_FT2 = 1.355817948331401  # JSBSim's own factor is off by 0.009 %
KG_M3_PER_SLUG_FT3 = 515.3788183932  # 14.59390294 kg by 0.3048³ m³

_AXES = {
    "DRAG": (None, {"cD0": (ATTACHED,), "cD_alpha": (ATTACHED, ALPHA),
                    "cD_alpha2": (ATTACHED, ALPHA, ALPHA), "plate_drag": (PLATE_DRAG,),
                    "cD_beta": (BETA,), "cD_beta2": (BETA, BETA),
                    "cD_de": (ELEVATOR,), "cD_de2": (ELEVATOR, ELEVATOR)}),
    "SIDE": (None, {"cY0": (), "cY_beta": (BETA,), "cY_p": (P,), "cY_r": (R,),
                    "cY_da": (AILERON,), "cY_dr": (RUDDER,)}),
    "LIFT": (None, {"cL0": (ATTACHED,), "cL_alpha": (ATTACHED, ALPHA), "cL_q": (Q,),
                    "cL_de": (ELEVATOR,), "plate_lift": (PLATE_LIFT,)}),
    "ROLL": ("metrics/bw-ft", {"cl0": (), "cl_beta": (BETA,), "cl_p": (P,), "cl_r": (R,),
                               "cl_da": (AILERON,), "cl_dr": (RUDDER,)}),
    "PITCH": ("metrics/cbarw-ft", {"cm0": (), "cm_alpha": (ALPHA,), "cm_q": (Q,),
                                   "cm_de": (ELEVATOR,)}),
    "YAW": ("metrics/bw-ft", {"cn0": (), "cn_beta": (BETA,), "cn_p": (P,), "cn_r": (R,),
                              "cn_da": (AILERON,), "cn_dr": (RUDDER,)}),
}  # fmt: skip
"""Of each axis of JSBSim, the length of a moment, and by what each coefficient is multiplied."""


def write_aircraft(
    folder: Path, aircraft: Aircraft, *, control: str = "", stop_rad: float = 0.5
) -> Path:
    """Write folder/NAME/NAME.xml for a new folder; return folder/NAME.

    Args:
        folder: The folder; its last part is not the aircraft's name.
        aircraft: Its rate derivatives are nondimensional.
        control: Components of the flight control in place of gains alone, as XML.
        stop_rad: What a command of 1 makes of each surface.
    """
    assert aircraft.rate_derivatives == "nondimensional"
    own = folder / "written"
    own.mkdir()
    (own / "written.xml").write_text(_xml(aircraft, control or _gains(stop_rad)))
    return own


def _xml(aircraft: Aircraft, control: str) -> str:
    J, rho = aircraft.inertia_kg_m2, aircraft.air_density_kg_m3 / KG_M3_PER_SLUG_FT3
    return f"""<?xml version="1.0"?>
<fdm_config name="written" version="2.0" release="ALPHA">
 <metrics>
  <wingarea unit="M2">{aircraft.wing_area_m2!r}</wingarea>
  <wingspan unit="M">{aircraft.wing_span_m!r}</wingspan>
  <chord unit="M">{aircraft.mean_chord_m!r}</chord>
  <location name="AERORP" unit="M"><x>0</x><y>0</y><z>0</z></location>
 </metrics>
 <mass_balance negated_crossproduct_inertia="false">
  <ixx unit="SLUG*FT2">{J.Jxx / KG_M2_PER_SLUG_FT2!r}</ixx>
  <iyy unit="SLUG*FT2">{J.Jyy / KG_M2_PER_SLUG_FT2!r}</iyy>
  <izz unit="SLUG*FT2">{J.Jzz / KG_M2_PER_SLUG_FT2!r}</izz>
  <ixz unit="SLUG*FT2">{J.Jxz / KG_M2_PER_SLUG_FT2!r}</ixz>
  <emptywt unit="KG">{aircraft.mass_kg!r}</emptywt>
  <location name="CG" unit="M"><x>0</x><y>0</y><z>0</z></location>
 </mass_balance>
 <ground_reactions/>
 <propulsion/>
 <flight_control name="FCS">
  <property value="{rho!r}">atmosphere/override/density</property>
  <channel name="all">{control}</channel>
 </flight_control>
 <aerodynamics>
  {_stall(aircraft)}
  {_rate(P, "p", "bi2vel")}{_rate(Q, "q", "ci2vel")}{_rate(R, "r", "bi2vel")}
  {"".join(_axis(name, aircraft, length, terms) for name, (length, terms) in _AXES.items())}
 </aerodynamics>
</fdm_config>
"""


def _gains(stop_rad: float) -> str:
    names = {"aileron": AILERON, "elevator": ELEVATOR, "rudder": RUDDER}
    return "".join(gain(name, output, stop_rad) for name, output in names.items())


def gain(name: str, output: str, value: float) -> str:
    """Return a component that makes a surface's angle of its command alone."""
    return (
        f'<pure_gain name="fcs/{name}-by-command"><input>fcs/{name}-cmd-norm</input>'
        f"<gain>{value!r}</gain><output>{output}</output></pure_gain>"
    )


def _stall(aircraft: Aircraft) -> str:
    """Share of the attached flow, and a flat plate's lift and drag by the other share."""
    if aircraft.stall_deg is None:
        return (
            _function(ATTACHED, "<value>1</value>")
            + _function(PLATE_LIFT, "<value>0</value>")
            + _function(PLATE_DRAG, "<value>0</value>")
        )
    stall, M = math.radians(aircraft.stall_deg), aircraft.stall_sharpness
    alpha = f"<property>{ALPHA}</property>"

    def blend(sign: float) -> str:
        shifted = f"<sum>{alpha}<value>{-sign * stall!r}</value></sum>"
        return f"<exp><product><value>{-sign * M!r}</value>{shifted}</product></exp>"

    above, below, one = blend(1.0), blend(-1.0), "<value>1</value>"
    both = f"<product><sum>{one}{above}</sum><sum>{one}{below}</sum></product>"
    share = f"<quotient><sum>{one}{above}{below}</sum>{both}</quotient>"
    normal = (
        f"<value>2</value><sin>{alpha}</sin><abs><sin>{alpha}</sin></abs>"
        f"<difference>{one}<property>{ATTACHED}</property></difference>"
    )
    return (
        _function(ATTACHED, f"<difference>{one}{share}</difference>")
        + _function(PLATE_LIFT, f"<product>{normal}<cos>{alpha}</cos></product>")
        + _function(PLATE_DRAG, f"<product>{normal}<sin>{alpha}</sin></product>")
    )


def _rate(name: str, axis: str, per: str) -> str:
    return _function(name, _product((f"velocities/{axis}-aero-rad_sec", f"aero/{per}")))


def _axis(
    name: str, aircraft: Aircraft, length: str | None, terms: dict[str, tuple[str, ...]]
) -> str:
    functions = ""
    for coefficient, factors in terms.items():
        common = ("aero/qbar-psf", "metrics/Sw-sqft", *((length,) if length else ()))
        value = getattr(aircraft.coefficients, coefficient, 1.0)
        functions += _function(f"aero/{coefficient}", _product((*common, *factors), value))
    return f'<axis name="{name}">{functions}</axis>'


def _function(name: str, body: str) -> str:
    return f'<function name="{name}">{body}</function>'


def _product(factors: Iterable[str], value: float = 1.0) -> str:
    properties = "".join(f"<property>{factor}</property>" for factor in factors)
    return f"<product>{properties}<value>{value!r}</value></product>"
