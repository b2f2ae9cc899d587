"""The two colour themes."""

from textual.theme import Theme

DARK = Theme(
    name="ftc-dark",
    dark=True,
    primary="#58a6ff",
    secondary="#7d8fa3",
    accent="#f0a35e",
    success="#4cc38a",
    warning="#e9b949",
    error="#f2616a",
    foreground="#d5dde5",
    background="#0c1015",
    surface="#0c1015",
    panel="#18202a",
    boost="#202b37",
    variables={
        "muted": "#74839a",
        "rule": "#2d3a49",
        "footer-key-foreground": "#58a6ff",
        "block-cursor-background": "#2a4365",
        "block-cursor-foreground": "#ffffff",
        "block-cursor-text-style": "none",
        "input-selection-background": "#58a6ff 40%",
    },
)

LIGHT = Theme(
    name="ftc-light",
    dark=False,
    primary="#0b62c4",
    secondary="#5b6b7d",
    accent="#b3540a",
    success="#14794a",
    warning="#8f6000",
    error="#c22834",
    foreground="#1d2733",
    background="#fcfdfe",
    surface="#fcfdfe",
    panel="#eaf0f6",
    boost="#dde6ef",
    variables={
        "muted": "#66758a",
        "rule": "#bccad8",
        "footer-key-foreground": "#0b62c4",
        "block-cursor-background": "#cfe2f7",
        "block-cursor-foreground": "#0b1d33",
        "block-cursor-text-style": "none",
        "input-selection-background": "#0b62c4 25%",
    },
)
