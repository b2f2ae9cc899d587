"""Text of others made safe to show: names, paths, texts of the wire and of files.

A control character in them could steer the reader's terminal, forge a line of a log, or turn text
around. Whoever shows or stores text that is not the project's own passes it through here.
"""

import sys
import unicodedata

_UNSEEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Unicode categories: controls (C0, DEL, C1), formats, lone surrogates, separators of lines and
paragraphs."""


def visible(text: str) -> str:
    r"""Return a text of one line in which each control character is an escape, such as ``\x1b``.

    Escapes are as in Python and YAML. What is visible already stays as it is, so that a second
    pass changes nothing.
    """
    return text if text.isprintable() else "".join(map(_seen, text))


def visible_lines(text: str) -> str:
    """Return `visible` text whose line feeds stay: the caller has laid out the lines."""
    return text if text.isprintable() else "\n".join(map(visible, text.split("\n")))


def log_line(text: object) -> None:
    """Write lines to standard error, which is the log of a process."""
    print(visible_lines(str(text)), file=sys.stderr, flush=True)


def _seen(character: str) -> str:
    if unicodedata.category(character) not in _UNSEEN:
        return character
    return character.encode("unicode_escape").decode()
