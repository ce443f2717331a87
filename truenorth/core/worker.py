"""What a worker process does first. Nothing else is loaded with it: what a worker loads afterwards takes most of its start."""

from __future__ import annotations

import atexit
import gc
import multiprocessing
import os
import threading
from importlib import import_module


def begin(*modules: str) -> None:
    """Load modules, and end with the parent."""
    end_with_parent()
    gc.disable()  # of what is loaded nothing is garbage, and to look for it takes a tenth of the time
    for module in modules:
        import_module(module)
    gc.enable()
    atexit.register(gc.freeze)  # what is there at the end goes with the process, without being looked through


def end_with_parent() -> None:
    """End this worker at once where its parent has died, however it died: nobody would take its result."""
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
