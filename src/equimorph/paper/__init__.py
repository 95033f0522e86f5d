"""The article by Fehér, Sipos and Várkonyi, computed anew with the public face of the library."""

from equimorph.paper.reproduction import Reproduction, reproduce

__all__ = ["Reproduction", "reproduce"]
