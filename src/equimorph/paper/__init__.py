"""The article by Fehér, Sipos and Várkonyi, reproduced with the public API of the library."""

from equimorph.paper.reproduction import Reproduction as Reproduction, reproduce as reproduce
