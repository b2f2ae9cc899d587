"""A Wireshark dissector for the dialect, in Lua, as pymavlink's generator makes it."""

import contextlib
import os
import shutil
import tempfile
from pathlib import Path

import mavlink_defs

__all__ = ["lua_dissector"]

_INCLUDED = ("common.xml", "standard.xml", "minimal.xml")
_PORTS = "14550,14560,14601-14850"  # the defaults of a scenario's links


def lua_dissector(ports: tuple[int, ...] = ()) -> str:
    """Generate the dissector; it takes half a second.

    Args:
        ports: UDP ports that carry our messages, besides the defaults of a scenario's links.
    """
    import pymavlink
    from pymavlink.generator import mavgen

    shipped = Path(pymavlink.__file__).parent / "dialects" / "v20"
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)  # the generator wants included definitions beside the including one
        for name in _INCLUDED:
            shutil.copy(shipped / name, work / name)
        shutil.copy(Path(mavlink_defs.__file__).parent / "ftc.xml", work / "ftc.xml")
        options = mavgen.Opts(str(work / "ftc.lua"), "2.0", language="WLua", validate=False)
        with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
            made = mavgen.mavgen(options, [str(work / "ftc.xml")])
        if not made:
            raise RuntimeError("pymavlink's generator refused ftc.xml")
        lua = (work / "ftc.lua").read_text()
    ours = ",".join([_PORTS, *map(str, ports)])
    return f"""{lua}
-- links of ftc-sitl
DissectorTable.get("udp.port"):add("{ours}", mavlink_proto)
"""
