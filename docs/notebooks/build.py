"""Execute the notebooks (``make notebooks``): each script next to this file becomes an .ipynb with its results inside."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import jupytext
from nbclient import NotebookClient

HERE = Path(__file__).resolve().parent


def main(names: list[str]) -> None:
    """Execute those named, or all; where one is and how long it took is printed."""
    for script in sorted(HERE.glob("[0-9]_*.py")):
        if names and script.stem not in names:
            continue
        notebook = jupytext.read(script)
        notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3", "language": "python"}
        begun = time.perf_counter()
        NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(HERE)}}).execute()
        for cell in notebook.cells:
            cell.metadata.pop("execution", None)  # times of day: they would differ in each run
            for output in cell.get("outputs", []):
                if "<img" in output.get("data", {}).get("text/html", ""):
                    output["data"].pop("image/png", None)  # it is in the page's text already
        jupytext.write(notebook, script.with_suffix(".ipynb"))
        print(f"{script.stem}: {time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
