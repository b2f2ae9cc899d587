"""Recordings as tables with names and units: Arrow, pandas, xarray."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from gcs.console.errors import BadInput
from gcs.console.extras import load_package
from gcs.results.quantities import PAPER_ORDER

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    import xarray as xr

INDEX = ("time_s", "uav")
"""What a row of a trajectory is of: simulated time [s] and system id."""


def units_of(schema: "pa.Schema", degrees: bool) -> dict[str, str]:
    """Return the unit of each column that has one."""
    units = {f.name: f.metadata[b"unit"].decode() for f in schema if f.metadata}
    return {
        name: unit.replace("rad", "deg") if degrees else unit
        for name, unit in units.items()
        if unit
    }


def chosen(
    table: "pa.Table", columns: Iterable[str] | None, uav: int | None, degrees: bool
) -> "pa.Table":
    """Return columns of a trajectory, of one UAV or of all, with its index in front.

    Args:
        table: Rows of `trajectory.arrows`.
        columns: Their names; None for all.
        uav: System id; None for all.
        degrees: Whether angles are converted from rad to deg.

    Raises:
        BadInput: There is no such column or UAV.
    """
    import pyarrow.compute as pc

    known = [name for name in table.column_names if name not in INDEX]
    names = known if columns is None else [columns] if isinstance(columns, str) else list(columns)
    if unknown := [name for name in names if name not in known]:
        raise BadInput(
            f"the recording has no column {', '.join(map(repr, unknown))}",
            f"it has {', '.join(known)}; all the laws' signals with record='full'",
        )
    if uav is not None:
        ids = sorted(pc.unique(table.column("uav")).to_pylist())
        if uav not in ids:
            raise BadInput(f"uav: expected {', '.join(map(str, ids))}, got {uav!r}")
        table = table.filter(pc.equal(table.column("uav"), uav))
    table = table.select([*INDEX, *names])
    if not degrees:
        return table
    for k, field in enumerate(table.schema):
        if b"rad" in (field.metadata or {}).get(b"unit", b""):
            values = np.degrees(table.column(k).to_numpy())
            table = table.set_column(k, field, _arrow(values))
    return table


def trajectory_frame(table: "pa.Table", degrees: bool, attributes: Mapping[str, Any]) -> Any:
    """Return a trajectory as a frame of pandas, with `INDEX` as its index."""
    frame = _frame(table).set_index(list(INDEX))
    frame.attrs = {**attributes, "units": units_of(table.schema, degrees)}
    return frame


def event_frame(table: "pa.Table", degrees: bool, attributes: Mapping[str, Any]) -> "pd.DataFrame":
    """Return the events as a frame of pandas."""
    frame = _frame(table)
    if degrees:
        angles = frame["actuator"] != "throttle"
        frame.loc[angles, "value"] = np.degrees(frame.loc[angles, "value"])
    frame.attrs = {**attributes, "units": units_of(table.schema, degrees)}
    frame["actuator"] = frame["actuator"].cat.set_categories(PAPER_ORDER)
    return frame


def dataset(
    table: "pa.Table", degrees: bool, names: Mapping[int, str], attributes: Mapping[str, Any]
) -> "xr.Dataset":
    """Return a trajectory as a dataset of xarray with the dimensions of `INDEX`."""
    xarray = load_package("xarray", "a dataset")
    uavs = list(dict.fromkeys(table.column("uav").slice(0, len(names) or None).to_pylist()))
    units = units_of(table.schema, degrees)

    def grid(name: str) -> np.ndarray:
        values: np.ndarray = table.column(name).to_numpy().reshape(-1, len(uavs))
        return values

    coordinates = {
        "time_s": ("time_s", grid("time_s")[:, 0], {"units": "s", "long_name": "simulated time"}),
        "uav": ("uav", uavs, {"long_name": "system id"}),
        "name": ("uav", [names.get(uav, "") for uav in uavs]),
    }
    variables = {
        name: (INDEX, grid(name), {"units": units.get(name, "")})
        for name in table.column_names
        if name not in INDEX
    }
    found: xr.Dataset = xarray.Dataset(variables, coordinates, dict(attributes))
    return found


def _frame(table: "pa.Table") -> Any:
    load_package("pandas", "a frame")
    return table.to_pandas()


def _arrow(values: np.ndarray) -> "pa.Array":
    import pyarrow as pa

    return pa.array(values)
