"""Machine code of a kernel, from an object file in memory to functions that can be called, without Numba and LLVM.

Numba and LLVM take .2 s to load, and a kernel from the disk needs neither: LLVM has made an object file of it (ELF), with the code
that unpacks Python's arguments. What is left is a linker's work: the sections are laid into memory, and each place that names
a symbol gets its address. Numba's code names few kinds of places: it is made for memory of any size, so that a
place holds all 64 bits of an address.

What it names of others are functions of Python, of the C library, and of the runtime of Numba (memory of arrays, exceptions),
which stands in extension modules that load without the rest of Numba.

Source: System V Application Binary Interface, AMD64 Architecture Processor Supplement, sections 4.3 to 4.4.
"""

from __future__ import annotations

import builtins
import ctypes
import math
import mmap
import os
import struct
import sys
from functools import cache
from typing import Any, NamedTuple

from truenorth.core.numba_part import numba_part

HEADER = b"\x7fELF\x02\x01\x01"  # of 64 bits, the lowest byte first
X86_64, OBJECT = 62, 1
NOTHING, UNWIND, RELOCATIONS, EMPTY = 0, 0x70000001, 4, 8  # kinds of sections
ALLOCATED, EXECUTABLE = 2, 4
COMMON = 0xFFF2  # in place of a section: a variable that the linker makes room for
ABSOLUTE, RELATIVE = 1, 24  # kinds of places: the address, and its distance from the place
WRAPPER, CALLBACK, ENVIRONMENT = "_ZN7cpython", "cfunc.", "_ZN08NumbaEnv"  # how Numba's names begin
PAGE = mmap.PAGESIZE


class CannotLinkError(Exception):
    """An object file that is left to Numba."""


class _Section(NamedTuple):
    name: int
    kind: int
    flags: int
    address: int
    offset: int
    size: int
    link: int
    info: int
    alignment: int
    entry_size: int


class _Symbol(NamedTuple):
    name: str
    section: int
    value: int
    size: int


def can_link() -> bool:
    """Whether this computer's object files are of the kind that is understood here."""
    return sys.platform == "linux" and os.uname().machine == "x86_64" and sys.implementation.name == "cpython"


class MachineCode:
    """An object file laid into memory; its functions live as long as this object.

    Parameters
    ----------
    content : bytes
        The object file, as Numba keeps it.
    environment : object
        Of Numba's kind; what the code takes for the environment of each function in it.

    Raises
    ------
    CannotLinkError
        A kind of file, place or symbol that is not understood, or memory that may not be executed.
    """

    def __init__(self, content: bytes, environment: Any) -> None:
        if not content.startswith(HEADER) or struct.unpack_from("<HH", content, 16) != (OBJECT, X86_64):
            raise CannotLinkError("not an object file of this kind of processor")
        self.content, self.environment = content, environment
        try:
            self.sections = self._read_sections()
            self.symbols = self._read_symbols()
        except (struct.error, ValueError, IndexError):
            raise CannotLinkError("a part of the file is missing") from None
        self.offsets: dict[int, int] = {}  # of sections, in the memory
        self.variables: dict[str, int] = {}  # offsets of variables
        code = self._place(0, executable=True)
        size = self._place_variables(self._place(-(-code // PAGE) * PAGE, executable=False))
        self.memory = mmap.mmap(-1, max(size, PAGE), flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        self._held = ctypes.c_char.from_buffer(self.memory)
        self.base = ctypes.addressof(self._held)
        self._fill()
        self._relocate()
        if _protect(self.base, code, mmap.PROT_READ | mmap.PROT_EXEC):
            raise CannotLinkError("the system does not let this memory be executed")

    def function(self, beginning: str) -> int:
        """Address of the one function whose name begins so.

        Raises
        ------
        CannotLinkError
            There is none, or several.
        """
        found = [s for s in self.symbols if s.name.startswith(beginning) and s.section in self.offsets]
        if len(found) != 1:
            raise CannotLinkError(f"{len(found)} functions whose names begin with {beginning}")
        return self._address(found[0])

    def _read_sections(self) -> list[_Section]:
        (begin,) = struct.unpack_from("<Q", self.content, 40)
        (count,) = struct.unpack_from("<H", self.content, 60)
        return [_Section(*struct.unpack_from("<IIQQQQIIQQ", self.content, begin + 64 * i)) for i in range(count)]

    def _read_symbols(self) -> list[_Symbol]:
        (table,) = [s for s in self.sections if s.kind == 2]
        names = self._part(self.sections[table.link])
        found = []
        for name, _, _, section, value, size in struct.iter_unpack("<IBBHQQ", self._part(table)):
            found.append(_Symbol(names[name : names.index(b"\0", name)].decode(), section, value, size))
        return found

    def _part(self, section: _Section) -> bytes:
        return self.content[section.offset : section.offset + section.size]

    def _place(self, at: int, executable: bool) -> int:
        """Lay out the sections that hold code, or the others; where they end."""
        for i, section in enumerate(self.sections):
            wanted = section.flags & ALLOCATED and section.kind != UNWIND
            if wanted and bool(section.flags & EXECUTABLE) == executable:
                at = _aligned(at, section.alignment)
                self.offsets[i] = at
                at += section.size
        return at

    def _place_variables(self, at: int) -> int:
        for symbol in self.symbols:
            if symbol.section == COMMON:  # its value is how it is aligned
                at = _aligned(at, symbol.value)
                self.variables[symbol.name] = at
                at += symbol.size
        return at

    def _fill(self) -> None:
        for i, at in self.offsets.items():
            if self.sections[i].kind != EMPTY:
                self.memory[at : at + self.sections[i].size] = self._part(self.sections[i])
        for name, at in self.variables.items():
            if name.startswith(ENVIRONMENT):
                struct.pack_into("<Q", self.memory, at, id(self.environment))

    def _relocate(self) -> None:
        addresses: dict[int, int] = {}
        for section in self.sections:
            begin = self.offsets.get(section.info)
            if section.kind != RELOCATIONS or begin is None:
                continue
            for offset, info, addend in struct.iter_unpack("<QQq", self._part(section)):
                symbol, kind = info >> 32, info & 0xFFFFFFFF
                if symbol not in addresses:
                    addresses[symbol] = self._address(self.symbols[symbol])
                if kind not in (ABSOLUTE, RELATIVE):
                    raise CannotLinkError(f"a place of kind {kind}")
                origin = self.base + begin + offset if kind == RELATIVE else 0
                struct.pack_into("<Q", self.memory, begin + offset, (addresses[symbol] + addend - origin) % 2**64)

    def _address(self, symbol: _Symbol) -> int:
        if symbol.section == COMMON:
            return self.base + self.variables[symbol.name]
        if symbol.section == NOTHING:
            return _address_of(symbol.name)
        if symbol.section not in self.offsets:
            raise CannotLinkError(f"{symbol.name} stands in no section that is laid into memory")
        return self.base + self.offsets[symbol.section] + symbol.value


def _aligned(at: int, alignment: int) -> int:
    return -(-at // max(alignment, 1)) * max(alignment, 1)


@cache
def _address_of(name: str) -> int:
    """Where a function or an object stands that does not belong to the kernel."""
    own = _of_runtime().get(name)
    if own is not None:
        return own
    try:
        return ctypes.addressof(ctypes.c_char.in_dll(ctypes.pythonapi, name))
    except ValueError:
        raise CannotLinkError(f"{name} is not known") from None


@cache
def _of_runtime() -> dict[str, int]:
    """Addresses by the names that Numba gives to its runtime, to mathematical functions and to Python's objects."""
    helpers, memory, functions = (numba_part(name) for name in ("_helperlib", "core.runtime._nrt_python", "_dynfunc"))
    found = {name: place for name, place in helpers.c_helpers.items() if hasattr(math, name)}
    for module in (helpers, functions):
        found |= {f"numba_{name}": place for name, place in module.c_helpers.items()}
    found |= {name if name.startswith("_") else f"NRT_{name}": place for name, place in memory.c_helpers.items()}
    errors = (e for e in vars(builtins).values() if isinstance(e, type) and issubclass(e, BaseException))
    found |= {f"PyExc_{error.__name__}": id(error) for error in errors}
    found["_Py_NoneStruct"] = id(None)
    return found


def _protect(address: int, size: int, access: int) -> int:
    """Change what may be done with memory; 0 where that was possible."""
    return int(_mprotect()(address, size, access))


@cache
def _mprotect() -> Any:
    function = ctypes.CDLL(None).mprotect
    function.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
    return function
