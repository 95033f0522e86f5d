"""Parts of kernels: what other kernels call, without machine code of its own.

numba optimises every function together with all that it calls and makes machine code of it, and
does so again in each function that calls it. A part is linked into its callers as it was lowered.

See docs/decisions.md, "Parts of kernels have no machine code".
"""

from typing import Any

import llvmlite.binding as llvm
from numba.core.caching import CompileResultCacheImpl
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult


class PartLibrary(JITCodeLibrary):
    """Code to link into that of callers."""

    def finalize(self) -> None:
        """Link what is called, without optimising it."""
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return no pointer: there is no machine code."""
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> Any:
        """What makes code, but for environments, which belong to machine code."""
        return _WithoutEnvironments(self._codegen)

    def serialize_using_object_code(self) -> Any:
        """Return the code for callers only."""
        return self.name, self._get_module_for_linking().as_bitcode()


class _WithoutEnvironments:
    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, environment: object) -> None:
        pass


class PartCompiler(Compiler):
    """numba's compiler, which lowers into the library of a part."""

    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any) -> None:
        super().__init__(typing, target, library or PartLibrary(target.codegen(), "part"), *rest)


class PartCacheImpl(CompileResultCacheImpl):
    """Reads parts from disk."""

    def rebuild(self, target_context: Any, payload: Any) -> CompileResult:
        """Return a part from what was kept."""
        (name, bitcode), fndesc, env, signature, objectmode, lifted, notes, reload, envs = payload
        library = PartLibrary(target_context.codegen(), name)
        library._final_module = library._shared_module = llvm.parse_bitcode(bitcode)
        library._finalized = True
        fields = {
            "target_context": target_context,
            "typing_context": target_context.typing_context,
            "library": library,
            "environment": env,
            "entry_point": target_context.get_executable(library, fndesc, env),
            "fndesc": fndesc,
            "type_annotation": notes,
            "signature": signature,
            "objectmode": objectmode,
            "lifted": lifted,
            "reload_init": reload,
            "referenced_envs": envs,
        }
        return CompileResult(*map(fields.get, CompileResult._fields))
