"""`python -m truenorth`, and the program `truenorth`: the command line, and the last resort where it fails."""

from __future__ import annotations

import sys

INTERRUPTED, INTERNAL = 130, 70
LATER = 0.02  # s


def main() -> None:
    """Run the program; an interrupt ends it with exit code 130 and an error that nobody foresaw with 70, each in one line."""
    sys.unraisablehook = _again
    try:
        from truenorth.cli import main as run

        run()
    except KeyboardInterrupt:  # also while the modules are loaded
        print("truenorth: interrupted; nothing half-written is left", file=sys.stderr)
        sys.exit(INTERRUPTED)
    except Exception as error:
        print(f"truenorth: internal error: {_in_one_line(error)}; {_details()}", file=sys.stderr)
        sys.exit(INTERNAL)


def _again(lost: sys.UnraisableHookArgs) -> None:
    """An interrupt that came where Python cannot raise it, such as in a callback of the compiler, comes again.

    A little later, that is: what is raised in this hook is lost too.
    """
    if lost.exc_type is KeyboardInterrupt:
        import _thread
        import threading

        later = threading.Timer(LATER, _thread.interrupt_main)
        later.daemon = True
        later.start()
    else:
        sys.__unraisablehook__(lost)


def _in_one_line(error: Exception) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"


def _details() -> str:
    """Write the traceback to a file of the system's temporary folder, and say where it is."""
    import tempfile
    import traceback

    try:
        with tempfile.NamedTemporaryFile(
            "w",
            prefix="truenorth-error-",
            suffix=".txt",
            delete=False,
            encoding="utf-8",
            errors="backslashreplace",  # of the names of files
        ) as file:
            file.write(f"{' '.join(sys.argv)}\n\n{traceback.format_exc()}")
    except OSError:
        return "the details could not be written to a file"
    return f"this is a defect of truenorth and not of your data; the details are in {file.name}: please report them"


if __name__ == "__main__":
    main()
