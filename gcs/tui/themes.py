"""The two colour themes."""

from typing import Any

from textual.theme import Theme

_COLOURS = {  # of the dark theme, and of the light one
    "primary": ("#58a6ff", "#0b62c4"),
    "secondary": ("#7d8fa3", "#5b6b7d"),
    "accent": ("#f0a35e", "#b3540a"),
    "success": ("#4cc38a", "#14794a"),
    "warning": ("#e9b949", "#8f6000"),
    "error": ("#f2616a", "#c22834"),
    "foreground": ("#d5dde5", "#1d2733"),
    "background": ("#0c1015", "#fcfdfe"),
    "surface": ("#0c1015", "#fcfdfe"),
    "panel": ("#18202a", "#eaf0f6"),
    "boost": ("#202b37", "#dde6ef"),
}
_VARIABLES = {
    "muted": ("#74839a", "#66758a"),
    "rule": ("#2d3a49", "#bccad8"),
    "footer-key-foreground": ("#58a6ff", "#0b62c4"),
    "block-cursor-background": ("#2a4365", "#cfe2f7"),
    "block-cursor-foreground": ("#ffffff", "#0b1d33"),
    "block-cursor-text-style": ("none", "none"),
    "input-selection-background": ("#58a6ff 40%", "#0b62c4 25%"),
}


def _theme(name: str, k: int) -> Theme:
    colours: dict[str, Any] = {key: pair[k] for key, pair in _COLOURS.items()}
    variables = {key: pair[k] for key, pair in _VARIABLES.items()}
    return Theme(name, dark=k == 0, variables=variables, **colours)


DARK, LIGHT = _theme("ftc-dark", 0), _theme("ftc-light", 1)
