"""Vectors of a MAT file as npz: ``python -m gcs.results.logs.mat_vectors FILE >VECTORS``.

A process of its own, as scipy's compiled reader can crash on damaged bytes.
"""

import sys
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np


def _vectors(place: str, tree: Mapping[str, Any]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield vectors of numbers; one in a structure is ``structure.field``."""
    for name, value in tree.items():
        if fields := getattr(value, "_fieldnames", None):
            yield from _vectors(f"{place}{name}.", {one: getattr(value, one) for one in fields})
        elif isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "fiub":
            yield f"{place}{name}", value.astype(float)


if __name__ == "__main__":
    from scipy.io import loadmat

    read = loadmat(sys.argv[1], squeeze_me=True, struct_as_record=False, appendmat=False)
    own = {name: value for name, value in read.items() if not name.startswith("__")}
    np.savez(sys.stdout.buffer, **{f"={name}": one for name, one in _vectors("", own)})
