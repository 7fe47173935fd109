"""One page of HTML that holds all it shows: text and pictures, to be mailed or kept beside the numbers."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..files import write_text

_STYLE = """
body { font-family: system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-weight: 600; } h2 { margin-top: 2.5rem; font-weight: 600; border-bottom: 1px solid #ddd; }
img { max-width: 100%; height: auto; }
pre { font-size: 0.8rem; overflow-x: auto; background: #f6f6f6; padding: 0.8rem; }
"""


@dataclass(frozen=True)
class Section:
    """A heading, pictures below it, and text as it would be printed."""

    title: str
    pictures: Sequence[Path] = ()
    text: str = ""
    note: str = ""


def write_page(path: Path, title: str, sections: Sequence[Section]) -> Path:
    """Write the page; pictures that are not there are left out. Returns the path."""
    parts = [_section(section) for section in sections]
    head = f"<meta charset=utf-8><title>{html.escape(title)}</title><style>{_STYLE}</style>"
    body = f"<h1>{html.escape(title)}</h1>\n" + "\n".join(parts)
    write_text(path, f"<!DOCTYPE html>\n<html lang=en><head>{head}</head>\n<body>\n{body}\n</body></html>\n")
    return path


def _section(section: Section) -> str:
    lines = [f"<h2>{html.escape(section.title)}</h2>"]
    if section.note:
        lines.append(f"<p>{html.escape(section.note)}</p>")
    for picture in section.pictures:
        if picture.is_file():
            data = base64.b64encode(picture.read_bytes()).decode()
            lines.append(f'<img alt="{html.escape(picture.stem)}" src="data:image/png;base64,{data}">')
    if section.text:
        lines.append(f"<pre>{html.escape(section.text)}</pre>")
    return "\n".join(lines)
