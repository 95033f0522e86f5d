from typing import Annotated as Bool
from typing import Annotated as Float
from typing import Annotated as Int
from typing import Annotated as Num
from typing import Annotated as Shaped
from typing import Annotated as UInt8
from typing import Annotated as UInt16

__all__ = ["Bool", "Float", "Int", "Num", "Shaped", "UInt8", "UInt16"]
