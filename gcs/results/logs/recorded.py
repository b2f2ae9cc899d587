"""Our own recordings as the table of a flight."""

import json
from pathlib import Path

import numpy as np

from gcs.console.errors import BadInput
from gcs.results.logs.reading import chosen_vehicle
from gcs.results.logs.table import FlightTable, by_name, channel
from gcs.results.store import TRAJECTORY, is_complete, read_table
from mavlink_defs.visible import visible


def read_recorded(path: Path, uav: int | None) -> FlightTable:
    """Read one UAV of a recording, light or full.

    Args:
        path: A run folder, or its `trajectory.arrows`.
        uav: System id; None: the first one.

    Raises:
        BadInput: There is no recording, or no such UAV in it.
    """
    file = path / TRAJECTORY if path.is_dir() else path
    table = read_table(file)
    if not len(table):
        raise BadInput(f"{file} has no rows")
    uavs = table.column("uav").to_numpy()
    ids = np.unique(uavs).tolist()
    chosen, remarks = chosen_vehicle(file, ids, uav, ids[0])
    rows = uavs == chosen
    time_s = table.column("time_s").to_numpy()[rows]
    channels = by_name(
        channel(
            name,
            time_s,
            table.column(name).to_numpy(zero_copy_only=False)[rows],
            f"{TRAJECTORY}, {name}",
            "simulated",
        )
        for name in table.column_names
        if name not in {"time_s", "uav"}
    )
    names = json.loads(table.schema.metadata.get(b"names", b"{}"))
    called = f" ({names[str(chosen)]})" if names.get(str(chosen)) else ""
    if not is_complete(file):
        remarks.append("the recording is torn: what was recorded before is read")
    return FlightTable(
        title=visible(f"{path.name}, UAV {chosen}{called}"),
        kind="recording",
        channels=channels,
        remarks=tuple(remarks),
    )
