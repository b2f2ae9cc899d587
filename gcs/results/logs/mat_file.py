"""MAT files, read in a process of their own, as scipy's compiled reader crashes on damaged bytes.

``python -m gcs.results.logs.mat_file FILE`` writes the vectors of one to its output, as npz.
"""

import io
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gcs.console.errors import BadInput
from gcs.console.extras import check_packages
from gcs.results.logs.reading import reading
from mavlink_defs.config.user_files import open_file
from mavlink_defs.visible import visible


def mat_vectors(path: Path) -> dict[str, np.ndarray]:
    """Return the vectors of a MAT file; one in a structure is ``structure.field``.

    Raises:
        BadInput: It cannot be read.
    """
    check_packages(("scipy",), f"{path.name}, a MAT file,", "lab")
    with reading(path), open_file(path) as file:
        if file.read(10) == b"MATLAB 7.3":
            raise BadInput(f"{path} is of MATLAB 7.3", "save it with -v7 in MATLAB")
    command = [sys.executable, "-P", "-m", "gcs.results.logs.mat_file", str(path)]
    done = subprocess.run(command, capture_output=True, check=False)
    if done.returncode:
        why = done.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2]
        reason = visible(why) or f"its reader crashed (signal {-done.returncode})"
        raise BadInput(f"{path} is no MAT file, or is cut off: {reason}")
    with np.load(io.BytesIO(done.stdout)) as vectors:
        return {name[1:]: vectors[name] for name in vectors.files}


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
    vectors: dict[str, Any] = {f"={name}": one for name, one in _vectors("", own)}
    np.savez(sys.stdout.buffer, **vectors)
