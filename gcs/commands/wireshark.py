"""``gcs wireshark``: write a dissector of the dialect for Wireshark and tshark."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from gcs.console.outputs import check_file, write_file
from mavlink_defs.constants import LAST_SYSTEM
from mavlink_defs.mavgen import generate
from mavlink_defs.ports import FORMATION_BASE_PORT, GCS_PORT, PLANT_PORT

_PORTS = f"{GCS_PORT},{PLANT_PORT},{FORMATION_BASE_PORT + 1}-{FORMATION_BASE_PORT + LAST_SYSTEM}"
"""The defaults of a scenario's links."""


def wireshark(
    out: Annotated[Path | None, typer.Option(metavar="FILE")] = None,
    port: Annotated[list[int] | None, typer.Option(min=1, max=65535, metavar="PORT")] = None,
) -> None:
    """Write a Wireshark dissector for all messages (Lua).

    Args:
        out: Output file; standard output by default.
        port: UDP port with our messages, besides the default ones; may be repeated.

    Examples:
        - gcs wireshark --out ~/.local/lib/wireshark/plugins/ftc.lua
        - gcs wireshark > ftc.lua
        - tshark -i lo -f udp -X lua_script:ftc.lua -Y mavlink_proto
        - tshark -r capture.pcap -X lua_script:ftc.lua -Y 'mavlink_proto.msgid == 93' | wc -l

    Wireshark loads the dissector from its plugin folder (Help, About Wireshark, Folders: Personal
    Lua Plugins). Install only one MAVLink dissector. It does not verify checksums.

    Exit status: 0 written, 1 the file cannot be written, 2 bad input.
    """
    if out is not None:
        check_file(out)
    lua = lua_dissector(tuple(port or ()))
    if out is None:
        sys.stdout.write(lua)
        return
    write_file(out, lua)


def lua_dissector(ports: tuple[int, ...] = ()) -> str:
    """Generate the dissector; it takes half a second.

    Args:
        ports: UDP ports that carry our messages, besides the defaults of a scenario's links.
    """
    lua = generate("WLua", validate=False)
    ours = ",".join([_PORTS, *map(str, ports)])
    return f"""{lua}
-- links of ftc-sitl
DissectorTable.get("udp.port"):add("{ours}", mavlink_proto)
"""
