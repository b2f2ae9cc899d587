"""Size of the residual set of each error, per segment of the profile."""

from typing import Any

import numpy as np

from gcs.results.quantities import TRACKED_KEYS, in_degrees
from gcs.results.recording import Recording
from gcs.scenario.model import Scenario

_WINDOW_S = 3.0


def residual_sets(recording: Recording, i: int, scenario: Scenario) -> list[dict[str, Any]]:
    """Return the largest |error| of UAV index i over the last 3 s of each segment flown.

    A mission has no segments: the whole flight counts as one.

    A segment cut off by the end of the flight counts up to there; one shorter than 3 s counts
    whole. Steps missing in the record (NaN) do not count.

    Returns:
        Per segment `start_s`, `end_s` (as flown), `from_s` (start of the window), `tracking`
        (Ṽ, e) and `synchronisation` (Ṽ', e' of (31), (32): weighted by λ1 to λ4), each by
        `airspeed_m_s`, `roll_deg`, `pitch_deg`, `yaw_deg`.
    """
    time_s = recording.time_s
    starts = [segment.start_s for segment in scenario.profile] or [0.0]
    sets = []
    for start_s, next_s in zip(starts, [*starts[1:], recording.duration_s], strict=True):
        end_s = min(next_s, recording.duration_s)
        from_s = max(start_s, end_s - _WINDOW_S)
        begun = (time_s > from_s) | ((from_s == 0.0) & (time_s == 0.0))
        counted = recording.signals[begun & (time_s <= end_s), i]
        if len(counted):
            sets.append(
                {
                    "start_s": start_s,
                    "end_s": end_s,
                    "from_s": from_s,
                    "tracking": _largest(counted["error"]),
                    "synchronisation": _largest(counted["sync_error"]),
                }
            )
    return sets


def _largest(errors: np.ndarray) -> dict[str, float | None]:
    known = np.abs(errors[np.isfinite(errors).all(axis=1)])
    largest = known.max(axis=0, initial=0.0)
    return {
        name: float(value) if len(known) else None
        for name, value in zip(TRACKED_KEYS, in_degrees(largest), strict=True)
    }
