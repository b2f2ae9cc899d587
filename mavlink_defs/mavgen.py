"""Code for the dialect from its definition, `ftc.xml`, by pymavlink's generator.

The build hook runs this file by its path, before the package can be imported.
"""

import contextlib
import io
import shutil
import tempfile
from pathlib import Path

_INCLUDED = ("common.xml", "standard.xml", "minimal.xml")
_DEFINITION = Path(__file__).parent / "ftc.xml"


def generate(language: str, *, validate: bool = True) -> str:
    """Generate the source text of the dialect.

    Args:
        language: As of pymavlink's generator: "Python3" or "WLua".
        validate: Check the definition against the schema, which takes seconds.

    Raises:
        RuntimeError: pymavlink refused the definition, with its reasons.
    """
    import pymavlink
    from pymavlink.generator import mavgen

    shipped = Path(pymavlink.__file__).parent / "dialects" / "v20"
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)  # the generator requires included definitions beside the including one
        for name in _INCLUDED:
            shutil.copy(shipped / name, work / name)
        shutil.copy(_DEFINITION, work / "ftc.xml")
        output = work / ("ftc.lua" if language == "WLua" else "dialect.py")
        options = mavgen.Opts(str(output), "2.0", language=language, validate=validate)
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            made = mavgen.mavgen(options, [str(work / "ftc.xml")])
        if not made:
            raise RuntimeError(f"pymavlink's generator refused {_DEFINITION}: {printed.getvalue()}")
        return output.read_text(encoding="utf-8")
