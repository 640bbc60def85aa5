"""What the documentation site needs beside its pages: formulas as pictures, and what is made from the code."""

import subprocess
import sys
from html import escape
from typing import Any

import ziamath
from references import fill

COMMAND_LINE = "<!-- the command line's own help -->"


def formula(source: str, *_: Any, **__: Any) -> str:
    """Return a LaTeX formula as SVG, in the text's colour; it needs no script and no font."""
    svg = ziamath.Latex(source, size=18, color="currentColor").svg()
    return f'<div role="img" aria-label="{escape(source)}" style="overflow: auto hidden">{svg}</div>'


def on_config(config: Any) -> Any:
    """Let fences of the language `math` be formulas."""
    fences = [{"name": "math", "class": "math", "format": formula}]
    config.mdx_configs.setdefault("pymdownx.superfences", {})["custom_fences"] = fences
    return config


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the command line's help and the tables of `references` where a page asks for them."""
    markdown = fill(markdown)
    if COMMAND_LINE not in markdown:
        return markdown
    command = [sys.executable, "-m", "typer", "multimodal_to.cli", "utils", "docs", "--name", "multimodal-to"]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return markdown.replace(COMMAND_LINE, text.split("\n", 1)[1])
