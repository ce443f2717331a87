"""A hook of mkdocs: the language of a page's own words, and references of docstrings as links."""

from __future__ import annotations

import re
from typing import Any

ROLE = re.compile(r":(?:attr|class|data|exc|func|meth|mod|obj):<code>~?([\w.]+)</code>")


def on_page_context(context: dict[str, Any], page: Any, config: Any, nav: Any) -> dict[str, Any]:
    """Chinese pages say so: browsers choose the glyphs and the punctuation by it, and search and contents are named in Chinese."""
    config.theme["language"] = "zh" if page.file.src_uri.startswith("zh/") else "en"
    return context


def on_page_content(html: str, page: Any, config: Any, files: Any) -> str:
    """References in docstrings (``:func:`name```) become a link where the page has the name, and code where it has not."""
    known = set(re.findall(r'id="(truenorth\.[\w.]+)"', html))

    def link(found: re.Match[str]) -> str:
        name = found[1]
        target = name if name.startswith("truenorth.") else f"truenorth.{name}"
        code = f"<code>{name.removeprefix('truenorth.')}</code>"
        return f'<a href="#{target}">{code}</a>' if target in known else code

    return ROLE.sub(link, html)
