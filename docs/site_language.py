"""Which language the site's own words have on a page: those of its chapter. A hook of mkdocs."""

from __future__ import annotations

from typing import Any


def on_page_context(context: dict[str, Any], page: Any, config: Any, nav: Any) -> dict[str, Any]:
    """Chinese pages say so: browsers choose the glyphs and the punctuation by it, and search and contents are named in Chinese."""
    config.theme["language"] = "zh" if page.file.src_uri.startswith("zh/") else "en"
    return context
