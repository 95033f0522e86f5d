"""Quasi-static shape control of soft, morphing structures.

Names are loaded when they are first used, so that importing the package costs nothing. The stub
`__init__.pyi` in this folder is the one list of them, read here and by type checkers.
"""

import lazy_loader

__version__ = "0.2.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
