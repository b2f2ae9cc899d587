"""Options of the commands that talk to a running fleet, and of the dashboard."""

from typing import Annotated, Literal, TypeAlias

import typer

from mavlink_defs.constants import GCS_PORT, HUB_PORT

SIGNING_KEY_VARIABLE = "FTC_SITL_SIGNING_KEY"
"""Environment variable with the path of a key file."""

UavOption = Annotated[
    str | None,
    typer.Option(
        "--uav", metavar="IDS", help="System ids, such as 1,3; the whole fleet by default."
    ),
]
ConnectOption = Annotated[
    str | None,
    typer.Option(
        "--connect",
        metavar="ADDRESS",
        envvar="FTC_SITL_CONNECT",
        help="udpin:HOST:PORT or udpout:HOST:PORT. Without it: the hub of `gcs up` "
        f"(udpout:127.0.0.1:{HUB_PORT}) if there is one, else udpin:127.0.0.1:{GCS_PORT}.",
    ),
]
TimeoutOption = Annotated[
    float,
    typer.Option("--timeout", min=0.1, metavar="S", help="How long to wait for a vehicle [s]."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON, nothing else.")]
SigningKeyOption = Annotated[
    str | None,
    typer.Option(
        "--signing-key",
        metavar="FILE",
        envvar=SIGNING_KEY_VARIABLE,
        help="Sign, and refuse unsigned frames, with this key (of `gcs key`).",
    ),
]
ThemeOption: TypeAlias = Annotated[
    Literal["dark", "light"],
    typer.Option("--theme", envvar="FTC_SITL_THEME", help="Colours: dark or light."),
]
