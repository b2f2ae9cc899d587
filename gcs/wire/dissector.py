"""A Wireshark dissector for the dialect, in Lua, as pymavlink's generator makes it."""

from mavlink_defs.constants import FORMATION_BASE_PORT, GCS_PORT, LAST_SYSTEM, PLANT_PORT
from mavlink_defs.mavgen import generate

_PORTS = f"{GCS_PORT},{PLANT_PORT},{FORMATION_BASE_PORT + 1}-{FORMATION_BASE_PORT + LAST_SYSTEM}"
"""The defaults of a scenario's links."""


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
