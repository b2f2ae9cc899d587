"""Keys with another name than in the version before; the names of before go in version `GONE`.

One table for all: what reads a key or a parameter by its name of before warns with `warn`. Models
say which section they are (`mavlink_defs.config.models.Renaming`).
"""

import warnings
from typing import NamedTuple

GONE = "0.3"
"""The first version that does not know the names of before."""


class RenamedKey(NamedTuple):
    """A key, relative to its section, and its parameter: before, and now."""

    before: str
    now: str
    parameter_before: str
    parameter: str


_LAW = (
    RenamedKey("takeover_s", "fallback_s", "TAKEOVER_S", "FALLBACK_S"),
    RenamedKey("takeover_threshold", "fallback_threshold", "TAKEOVE_THRESHOL", "FALLBACK_THRESH"),
    RenamedKey("rescue_deg", "fallback_error_deg", "RESCUE_DEG", "FALLBACK_ERR_DEG"),
    RenamedKey("storm_events", "event_rate_limit", "STORM_EVENTS", "EVENT_RATE_LIMIT"),
    RenamedKey("storm_s", "event_rate_cooldown_s", "STORM_S", "EVENT_COOLDOWN_S"),
)
_DIAGNOSIS = tuple(
    RenamedKey(before, f"throttle.{now}", parameter_before, parameter)
    for before, now, parameter_before, parameter in (
        ("throttle_lag_s", "lag_s", "DIAG_THROT_LAG_S", "DIAG_THR_LAG_S"),
        ("throttle_dead_time_s", "dead_time_s", "DI_THR_DEA_TIM_S", "DI_THR_DEA_TIM_S"),
        ("throttle_window_s", "window_s", "DIAG_THRO_WIND_S", "DIAG_THR_WINDO_S"),
        ("jump_n", "jump_n", "DIAG_JUMP_N", "DIAG_THR_JUMP_N"),
        ("excitation_n", "excitation_n", "DIAG_EXCITATIO_N", "DIAG_THR_EXCIT_N"),
        ("prior_n", "prior_n", "DIAG_PRIOR_N", "DIAG_THR_PRIOR_N"),
        ("throttle_confirm_s", "confirm_s", "DIAG_THRO_CONF_S", "DIAG_THR_CONFI_S"),
        ("throttle_offset_s", "offset_s", "DIAG_THRO_OFFS_S", "DIAG_THR_OFFSE_S"),
        ("dither_n", "dither_n", "DIAG_DITHER_N", "DIAG_THR_DITHE_N"),
        ("throttle_dither_half_s", "dither_half_s", "DI_THR_DIT_HAL_S", "DI_THR_DIT_HAL_S"),
        ("throttle_suspicion_s", "suspicion_s", "DIAG_THRO_SUSP_S", "DIAG_THR_SUSPI_S"),
        ("probe_n", "probe_n", "DIAG_PROBE_N", "DIAG_THR_PROBE_N"),
        ("throttle_check_s", "check_s", "DIAG_THRO_CHEC_S", "DIAG_THR_CHECK_S"),
        ("throttle_return_start_s", "return_start_s", "DI_THR_RET_STA_S", "DI_THR_RET_STA_S"),
    )
)
SECTIONS = {"controller": _LAW, "controller.diagnosis": _DIAGNOSIS}
"""The renamed keys by the section of a scenario that has them."""
PARAMETERS = {
    key.parameter_before: key.parameter
    for keys in SECTIONS.values()
    for key in keys
    if key.parameter_before != key.parameter
}
"""Parameters by their names of before."""


class RenamedWarning(FutureWarning):
    """A name of before was used."""


def names_of(section: str) -> dict[str, str]:
    """Return the keys of a section by their names of before."""
    return {key.before: key.now for key in SECTIONS[section]}


def text_of(before: str, now: str) -> str:
    """Return the warning that a name of before was used: of a key, or of a parameter."""
    return f"{before} is {now} now; version {GONE} will not know {before}"


def warn(before: str, now: str) -> None:
    """Warn that a name of before was used; Python says each text once."""
    warnings.warn(text_of(before, now), RenamedWarning, stacklevel=2)


def present(place: str) -> str:
    """Return a place of a scenario, such as ``controller.rescue_deg``, by its present name."""
    section, _, key = place.rpartition(".")
    return f"{section}.{names_of(section).get(key, key)}" if section in SECTIONS else place
