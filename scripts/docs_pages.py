"""Reference pages from the code: a hook of mkdocs that fills them in when the site is built.

The comment ``<!-- generated: keys trigger -->`` becomes the table of the keys of `trigger`.
"""

import html
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import typer
import yaml
from typer.cli import get_docs_for_click

from gcs.commands.cli import whole_command
from scripts.docs_dialect import commands, enums, messages
from scripts.docs_keys import keys, parameters, renamed

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
MARK = re.compile(r"^<!-- generated: (\w+)(?: (\S+))? -->$", re.MULTILINE)


def on_page_markdown(markdown: str, **_: object) -> str:
    """Fill in the generated parts of a page; mkdocs calls this for each page.

    Raises:
        KeyError: The page asks for something that does not exist.
    """
    return MARK.sub(lambda mark: GENERATORS[mark[1]](*filter(None, [mark[2]])), markdown)


def command_line() -> str:
    """Return a section for each command of `gcs`, as its help text has it.

    Lists of commands have whole sentences, and link to the commands; usage lines can be copied.
    """
    _show_whole_sentences(command := whole_command())
    text = get_docs_for_click(obj=command, ctx=typer.Context(command, info_name="gcs"), name="gcs")
    text = text.partition("\n")[2].replace("```console\n$ ", "```text\n")
    name = "gcs"

    def linked(line: re.Match[str]) -> str:
        nonlocal name
        if line["heading"]:
            name = line["heading"]
            return f"#{line[0]}"
        command = f"{name} {line['entry']}"
        return f"* [`{command}`](#{command.replace(' ', '-')})"

    # commands have small letters only, unlike options and arguments
    return re.sub(
        r"^(?:#+ `(?P<heading>.+)`$|\* `(?P<entry>[a-z][a-z-]*)`)", linked, text, flags=re.MULTILINE
    )


def _show_whole_sentences(command: Any) -> None:
    for sub in getattr(command, "commands", {}).values():
        sub.short_help = (sub.help or "").partition("\n\n")[0].replace("\n", " ")
        _show_whole_sentences(sub)


def pages(title: str) -> str:
    """Return a list of the pages under a title of the navigation, each with its first sentence."""
    return "\n".join(
        f"- [{name}]({path}){first_sentence(DOCS / path)}"
        for name, path in navigation()[title].items()
    )


def navigation() -> dict[str, dict[str, str]]:
    """Return the pages of the site by title and name, as `mkdocs.yml` has them, paths in `docs`.

    The home page is not among them.
    """
    _, *groups = yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]
    return {
        title: {name: path for page in entries for name, path in page.items()}
        for group in groups
        for title, entries in group.items()
    }


def first_sentence(page: Path) -> str:
    """Return ": " and the first sentence of a page without its links; nothing without prose."""
    text = re.sub(r"^```.*?^```|^<!--.*?-->", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    prose = (part for part in text.split("\n\n") if re.match(r"[\w\"*`]", part.lstrip("\n")))
    paragraph = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", " ".join(next(prose, "").split()))
    sentence = re.match(r"((?:`[^`]*`|[^`])*?(?<!Fig))(?:[.?] |[.:]$)", paragraph)
    return f": {sentence[1]}." if sentence else ""


def readme(title: str) -> str:
    """Return a section of the README without its heading; `_` in its title stand for blanks."""
    text = (ROOT / "README.md").read_text().split(f"\n## {title.replace('_', ' ')}\n")[1]
    return text.partition("\n## ")[0].strip("\n").replace("](docs/", "](")


def notebook(name: str) -> str:
    """Return a notebook of `docs/notebooks` as Markdown, with the outputs that it holds."""
    cells = json.loads((DOCS / "notebooks" / f"{name}.ipynb").read_text())["cells"]
    return "\n\n".join(part for cell in cells for part in _cell_parts(cell))


def _cell_parts(cell: dict[str, Any]) -> Iterator[str]:
    """Yield a cell and its outputs as Markdown: text, HTML without its style, or a picture."""
    source = "".join(cell["source"])
    if cell["cell_type"] != "code":
        yield source
        return
    yield f"```python\n{source}\n```"
    for output in cell["outputs"]:
        shown = output.get("data", {"text/plain": output.get("text")})
        if "image/png" in shown:
            picture = shown["image/png"].replace("\n", "")
            yield f'<img alt="{html.escape(source)}" src="data:image/png;base64,{picture}">'
        elif "text/html" in shown:
            yield re.sub(r"<style.*?</style>\n?", "", "".join(shown["text/html"]), flags=re.DOTALL)
        else:
            yield f"```text\n{''.join(shown['text/plain']).rstrip()}\n```"


GENERATORS: dict[str, Callable[..., str]] = {
    "keys": keys,
    "parameters": parameters,
    "renamed": renamed,
    "messages": messages,
    "enums": enums,
    "commands": commands,
    "command_line": command_line,
    "pages": pages,
    "readme": readme,
    "notebook": notebook,
}
