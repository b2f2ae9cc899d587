"""Other people's MAVLink programs with our dialect: ``ftc-mavlink PROGRAM [ARGUMENTS]``.

pymavlink finds a dialect by the name of a module of its own. This starts a Python program that
uses pymavlink (MAVProxy, mavlogdump.py, …) in this interpreter, where a module of the name
"ftc" is our dialect; nothing of pymavlink is changed. Tell the program ``--dialect ftc``.
"""

import importlib.util
import os
import runpy
import shutil
import sys
from pathlib import Path
from typing import Any

from mavlink_defs.visible import log_line

__all__ = ["main", "offer_dialect"]

NAME = "ftc"

_BORROWED = {"MAVLINK_MSG_ID_RADIO": 166}  # ArduPilot's; MAVProxy's signing requires the name


def offer_dialect() -> None:
    """Let pymavlink's tools find our dialect in this process; call it before they are imported."""
    from pymavlink.dialects import v20

    from mavlink_defs import dialect

    sys.modules[f"{v20.__name__}.{NAME}"] = dialect
    setattr(v20, NAME, dialect)
    for name, value in _BORROWED.items():
        if not hasattr(dialect, name):
            setattr(dialect, name, value)
    os.environ["MAVLINK_DIALECT"], os.environ["MAVLINK20"] = NAME, "1"


def main(arguments: list[str] | None = None) -> None:
    """Run the program named by the first argument, which gets the others."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if not arguments or arguments[0] in {"-h", "--help"}:
        print("usage: ftc-mavlink PROGRAM [ARGUMENTS], such as:")
        print("  ftc-mavlink mavproxy.py --dialect ftc --master udpin:127.0.0.1:14550")
        print("  ftc-mavlink mavlogdump.py --dialect ftc --types FTC_EVENTS flight.tlog")
        sys.exit(0 if arguments else 2)
    beside = Path(sys.executable).parent / arguments[0]
    program = str(beside) if beside.is_file() else shutil.which(arguments[0])
    if program is None:
        log_line(f"ftc-mavlink: there is no program '{arguments[0]}'")
        log_line("hint: MAVProxy comes with `pip install MAVProxy`")
        sys.exit(2)
    if importlib.util.find_spec("pymavlink") is None:
        log_line("ftc-mavlink needs pymavlink, not installed here")
        log_line("hint: pip install pymavlink==2.4.50 (the extra `tools`)")
        sys.exit(2)
    offer_dialect()
    if Path(program).name == "mavgraph.py":
        _mend_matplotlib()
    sys.argv = [program, *arguments[1:]]
    runpy.run_path(program, run_name="__main__")


def _mend_matplotlib() -> None:
    """Restore the matplotlib function that mavgraph.py of pymavlink 2.4.50 calls."""
    from matplotlib.axes import Axes

    def plot_date(axes: Axes, x: Any, y: Any, tz: Any = None, **how: Any) -> Any:
        axes.xaxis_date(tz)
        return axes.plot(x, y, **how)

    if not hasattr(Axes, "plot_date"):
        Axes.plot_date = plot_date  # type: ignore[attr-defined]  # gone from matplotlib


if __name__ == "__main__":
    main()
