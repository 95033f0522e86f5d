"""Annotations of arrays: ``Float[np.ndarray, "lanes size"]`` holds floats and has two named axes.

Type checkers read the stub beside this file and take them for arrays. At run time they only keep
the names of the axes, which argument checks and files use. Where jaxtyping is loaded first, as by
tests that check every shape, they are its classes.

See docs/decisions.md, "Array shapes are names at run time".
"""

import sys
from functools import cache
from typing import Any


class ArrayType(type):
    """An annotation of arrays.

    dtypes: words that the names of the types of numbers contain. dim_str: names of the axes.
    """

    dtypes: tuple[str, ...]
    dim_str: str

    def __getitem__(cls, item: tuple[Any, str]) -> "ArrayType":
        """Annotation of arrays with named axes, separated by spaces."""
        array, axes = item
        return _annotation(cls, getattr(array, "__name__", str(array)), " ".join(axes.split()))


@cache
def _annotation(kind: ArrayType, array: str, axes: str) -> ArrayType:
    name = f"{kind.__name__}[{array}, '{axes}']"
    return ArrayType(name, (), {"dtypes": kind.dtypes, "dim_str": axes})


def _kind(name: str, *dtypes: str) -> Any:
    checked = sys.modules.get("jaxtyping")
    return ArrayType(name, (), {"dtypes": dtypes}) if checked is None else getattr(checked, name)


Bool, Float, Int = _kind("Bool", "bool"), _kind("Float", "float"), _kind("Int", "int")
Complex = _kind("Complex", "complex")
Num, Shaped = _kind("Num", "float", "int"), _kind("Shaped", "any")
UInt8, UInt16 = _kind("UInt8", "uint8"), _kind("UInt16", "uint16")
