"""Error states: those of the INS itself and groups that come on top, each written once."""

from typing import TYPE_CHECKING

from truenorth.core.lazy import lazy

if TYPE_CHECKING:
    from truenorth.errors.deflection import Deflection
    from truenorth.errors.group import Group, columns
    from truenorth.errors.log import LogErrors
    from truenorth.errors.master import MasterErrors
    from truenorth.errors.model import InsModel

__all__ = [
    "Deflection",
    "Group",
    "InsModel",
    "LogErrors",
    "MasterErrors",
    "columns",
]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "Deflection": "deflection",
        "Group": "group",
        "InsModel": "model",
        "LogErrors": "log",
        "MasterErrors": "master",
        "columns": "group",
    },
)
