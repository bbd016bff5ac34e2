"""Variables of a running FMU that are read, or set, together; for the process in which it runs."""

import ctypes as c
from typing import Any

import numpy as np

_C_TYPES = {
    "Float32": c.c_float, "Float64": c.c_double, "Int8": c.c_int8, "UInt8": c.c_uint8,
    "Int16": c.c_int16, "UInt16": c.c_uint16, "Int32": c.c_int32, "UInt32": c.c_uint32,
    "Int64": c.c_int64, "UInt64": c.c_uint64, "Boolean": c.c_bool, "String": c.c_char_p,
}  # fmt: skip
#: FMI 2 has four types; its truth values are whole numbers.
_FMI2 = {
    "Float64": ("Real", c.c_double), "Int32": ("Integer", c.c_int32),
    "Boolean": ("Boolean", c.c_int32), "String": ("String", c.c_char_p),
}  # fmt: skip


_STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")


class FmuFailure(Exception):
    """What an FMU refused, in its own words."""


def make_failure(call: str, status: int, words: str) -> FmuFailure:
    """Return the error for a call that returned a bad status, with the given log text."""
    return FmuFailure(f"{call} returned {_STATUS[min(status, 5)]}{words}")


class ValueGroup:
    """The variables of one type that are read, or set, together, and their buffer.

    Parameters
    ----------
    fmu : Instance
        Whose functions are called.
    kind : str
        The type, by its name in FMI 3.
    variables : list of (value reference, number of elements)
    verb : {"Get", "Set"}
    """

    def __init__(self, fmu: Any, kind: str, variables: Any, verb: str) -> None:
        name, self.type = (kind, _C_TYPES.get(kind)) if fmu.three else _FMI2[kind]
        self.fmu, self.kind, self.text = fmu, kind, kind in ("String", "Binary")
        self.call = f"fmi{3 if fmu.three else 2}{verb}{name}"
        references = [reference for reference, _ in variables]
        self.count = sum(size for _, size in variables)
        self.references: Any = (c.c_uint32 * len(references))(*references)
        self._function = fmu.library_function(self.call)
        if kind == "Binary":
            self.sizes = (c.c_size_t * self.count)()
            self.buffer: Any = (c.POINTER(c.c_uint8) * self.count)()
            middle = [self.sizes]
        else:
            self.buffer, middle = (self.type * self.count)(), []
        if not self.text:
            self.values = np.frombuffer(self.buffer, dtype=np.dtype(self.type))
        tail = [c.c_size_t(self.count)] if fmu.three else []
        head = [fmu.component, self.references, c.c_size_t(len(references))]
        self._arguments = (*head, *middle, self.buffer, *tail)

    def get_or_set_buffer(self) -> None:
        """Call the FMU's Get or Set, which fills the buffer or takes the values from it."""
        status = self._function(*self._arguments)
        if status > 1:
            self.fmu.raise_failure(self.call, status)

    def set_values(self, values: Any) -> None:
        """Set the variables to the given texts or numbers at once."""
        if self.kind == "Binary":
            kept = [(c.c_uint8 * len(value)).from_buffer_copy(value) for value in values]
            for place, item in enumerate(kept):
                self.buffer[place] = c.cast(item, c.POINTER(c.c_uint8))
                self.sizes[place] = len(item)
        elif self.text:
            for place, value in enumerate(values):
                self.buffer[place] = value.encode()
        else:
            self.buffer[:] = values
        self.get_or_set_buffer()

    def read_texts(self) -> list[str]:
        """Return the texts that were read, bytes as hexadecimal digits."""
        if self.kind == "Binary":
            return [c.string_at(p, n).hex() for p, n in zip(self.buffer, self.sizes, strict=True)]
        return [(value or b"").decode(errors="replace") for value in self.buffer]
