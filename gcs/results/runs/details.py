"""What the page shows of a run besides its row: all keys of its scenario, curves, a thumbnail."""

import base64
import io
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gcs.console.errors import BadInput
from gcs.results.quantities import QUANTITIES
from gcs.results.run_folder import SCENARIO
from gcs.results.store import EVENTS, TRAJECTORY, batches
from gcs.scenario.settings import label
from mavlink_defs.config.files import read
from mavlink_defs.config.models import ConfigError
from mavlink_defs.config.renamed import present

_POINTS = 160
_MAX_BYTES = 200_000_000  # bytes of a recording that is read for its curves
_WIDTH = 240  # of a thumbnail [px]
_FIGURES = ("flight.png", "sweep.png", "polar.png", "figures/*.png")


def scenario_keys(folder: Path) -> dict[str, str]:
    """Return every key of a run's scenario with its value as a text; none if it has no scenario.

    Keys are as ``--set`` takes them, such as ``faults[0].uav``, by their present names.
    """
    try:
        tree = read(folder / SCENARIO)
    except ConfigError:
        return {}
    return {present(place): text for place, text in leaves(tree, "")}


def leaves(value: Any, place: str) -> Iterator[tuple[str, str]]:
    """Yield every key below a place of a scenario, with its value as a text."""
    if isinstance(value, Mapping) and value:
        for key, inner in value.items():
            yield from leaves(inner, f"{place}.{key}" if place else str(key))
    elif isinstance(value, list) and any(isinstance(one, Mapping) for one in value):
        for number, inner in enumerate(value):
            yield from leaves(inner, f"{place}[{number}]")
    else:
        yield place, label(value)


def own_keys(keys: Sequence[Mapping[str, str]]) -> tuple[dict[str, str], list[dict[str, str]]]:
    """Return the commonest value of each key, and of each run the keys that differ from them.

    A key that a run does not have differs, as "". Runs without any key are not counted.
    """
    known = [one for one in keys if one]
    names = dict.fromkeys(name for one in known for name in one)
    common = {
        name: Counter(one.get(name, "") for one in known).most_common(1)[0][0] for name in names
    }
    own = [
        {name: one.get(name, "") for name in names if one.get(name, "") != common[name]}
        if one
        else {}
        for one in keys
    ]
    return common, own


def curves_of(folder: Path) -> dict[str, Any] | None:
    """Return a recorded flight as a few points; None if it has no recording, or a very large one.

    Returns:
        ``end_s``; by quantity the largest error of any UAV against its reference within equal
        parts of the time [m/s, deg], None where there is none; ``events``, their sum so far.
    """
    path = folder / TRAJECTORY
    try:
        if path.stat().st_size > _MAX_BYTES:
            return None
        names = [f"error_{name}" for name in QUANTITIES]
        columns = [
            [batch.column(name).to_numpy() for name in ("time_s", *names)]
            for batch in batches(path)
        ]
        if not columns:
            return None
        time_s, *errors = (np.concatenate(column) for column in zip(*columns, strict=True))
        events = [np.asarray(batch.column("time_s")) for batch in batches(folder / EVENTS)]
    except (OSError, BadInput, KeyError):
        return None
    end_s = float(time_s[-1])
    part = np.minimum((time_s / (end_s or 1.0) * _POINTS).astype(int), _POINTS - 1)
    curves: dict[str, Any] = {"end_s": end_s}
    for name, error in zip(QUANTITIES, errors, strict=True):
        largest = np.full(_POINTS, -np.inf)
        size = np.abs(error if name == "airspeed" else np.degrees(error))
        np.maximum.at(largest, part, np.where(np.isfinite(size), size, -np.inf))
        curves[name] = [_digits(value) for value in largest]
    edges = np.linspace(0.0, end_s, _POINTS + 1)[1:]
    times = np.sort(np.concatenate(events)) if events else np.empty(0)
    curves["events"] = np.searchsorted(times, edges, side="right").tolist()
    return curves


def _digits(value: float) -> float | None:
    return float(f"{value:.4g}") if np.isfinite(value) else None


def figure_of(folder: Path) -> Path | None:
    """Return the figure that stands for a run; None if it has none."""
    return next((path for name in _FIGURES for path in sorted(folder.glob(name))), None)


def thumbnail(figure: Path) -> str:
    """Return a small copy of a figure as a data URI; "" if it cannot be read."""
    from PIL import Image

    small = io.BytesIO()
    try:
        with Image.open(figure) as image:
            image.thumbnail((_WIDTH, 2 * _WIDTH))
            image.convert("RGB").save(small, "WEBP", quality=70)
    except (OSError, ValueError, SyntaxError):  # of PIL, of a damaged file
        return ""
    return f"data:image/webp;base64,{base64.b64encode(small.getvalue()).decode()}"
