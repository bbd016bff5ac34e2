"""Pages that the site adds while it is built: one for each block type, cut from reference.md."""

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

_PAGE, _FOLDER = "reference.md", "reference/blocks"


def on_files(files: Files, config: Any) -> Files:
    """Add a page for each block type, and what the theme lacks for those who do not see colours."""
    for part in ("site.css", "site.js"):
        text = (Path(__file__).parent / part).read_text(encoding="utf-8")
        files.append(File.generated(config, f"assets/{part}", content=text))
    page = files.get_file_from_path(_PAGE)
    for name, text in _blocks(page.content_string):
        text = text.replace("](#", f"](../../{_PAGE}#")
        content = f"---\nhide: [toc]\n---\n# {name}\n{text}\n[All block types](../../{_PAGE})\n"
        files.append(File.generated(config, f"{_FOLDER}/{name}.md", content=content))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Put a list of those pages in the place of what is on them."""
    if page.file.src_uri != _PAGE:
        return markdown
    begin, _, rest = markdown.partition("## Blocks\n")
    _, _, end = rest.partition("\n## ")
    rows = "\n".join(
        f"| [{name}]({_FOLDER}/{name}.md) | {_first_sentence(text)} |"
        for name, text in _blocks(markdown)
    )
    return f"{begin}## Blocks\n\n| type | what it does |\n|---|---|\n{rows}\n\n## {end}"


def _blocks(markdown: str) -> list[tuple[str, str]]:
    """Return the sections of the block types, each with its name."""
    part = markdown.partition("## Blocks\n")[2].partition("\n## ")[0]
    pieces = re.split(r"^### (.+)$", part, flags=re.MULTILINE)[1:]
    return list(zip(pieces[::2], pieces[1::2], strict=True))


def _first_sentence(text: str) -> str:
    return text.strip().partition("\n\n")[0].replace("\n", " ")
