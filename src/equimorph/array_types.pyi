from typing import (
    Annotated as Bool,
    Annotated as Complex,
    Annotated as Float,
    Annotated as Int,
    Annotated as Num,
    Annotated as Shaped,
    Annotated as UInt8,
    Annotated as UInt16,
)

__all__ = ["Bool", "Complex", "Float", "Int", "Num", "Shaped", "UInt8", "UInt16"]
