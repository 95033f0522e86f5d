"""Write the list of calls of kernels anew: every call that the compiled code on disk was made for.

``python benchmarks/list_kernel_calls.py`` after the tests, the slow ones, too, have run since the
last change of a kernel. Those of the package that are called from Python are listed, the largest
code first. Marked are those that a set of a small spring needs, and of those that one of an arch
and its figure need what belongs to sets of any structure.
"""

import ast
import re
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

from numba import typeof
from numba.core.dispatcher import Dispatcher

import equimorph as em
from equimorph.linalg.compile_ahead import LIST

PACKAGE = Path(em.__file__).parent
OF_SETS = tuple(f"equimorph.{each}." for each in ("equilibria", "manifold", "marching", "plotting"))
ARRAY = re.compile(r"Array\((\w+), (\d), 'C', False, aligned=True\)")


def main() -> None:
    """Write the list."""
    kernels = [each for name in sorted(called_from_python()) if (each := kernel(name)) is not None]
    common = calls_of_small_sets()
    rows = []
    for name, dispatcher in kernels:
        index = dispatcher._cache._cache_file._load_index()
        for key, file in index.items():
            size = Path(dispatcher._cache.cache_path, file).stat().st_size
            mark = "every study" if (name, key[0]) in common else ""
            rows.append((-size, f"{name}\t{text(key[0])}\t{mark}\n"))
    LIST.write_text("".join(row for _, row in sorted(rows)))


def called_from_python() -> set[str]:
    """Names that modules without kernels import from modules of kernels, or look up in them."""
    found = set()
    for path in PACKAGE.rglob("*.py"):
        if path.stem.endswith(("kernels", "simd")):
            continue
        tree, modules = ast.parse(path.read_text()), {}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module:
                found |= {f"{node.module}.{each.name}" for each in node.names}
                modules |= {
                    each.asname or each.name: f"{node.module}.{each.name}" for each in node.names
                }
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                found.add(f"{modules.get(node.value.id, '')}.{node.attr}")
    return {name for name in found if name.rpartition(".")[0].endswith("kernels")}


def kernel(name: str) -> tuple[str, Dispatcher] | None:
    """Kernel of a name, under the module where it is defined."""
    module, _, short = name.rpartition(".")
    found = getattr(import_module(module), short)
    return (name, found) if isinstance(found, Dispatcher) else None


def calls_of_small_sets() -> set[tuple[str, tuple[object, ...]]]:
    """Calls of kernels while equilibria are found, followed and joined to a set."""
    made, compile_here = set(), Dispatcher._compile_for_args

    def note(self: Dispatcher, *args: object) -> object:
        made.add((f"{self.py_func.__module__}.{self.py_func.__name__}", tuple(map(typeof, args))))
        return compile_here(self, *args)

    Dispatcher._compile_for_args = note
    spring, arch = em.Spring(), em.Rod(load="uniform")
    em.equilibrium_set(spring, em.Box(x_l=(0.4, 1.4), F=(-0.3, 0.3)), intervals=(4, 4))
    em.find_equilibria(spring, {"x_l": 0.8, "F": 0.0})
    em.limit_load(spring.natural_state(x_l=0.8), "F")
    by_spring = set(made)
    box, within = em.Box(Theta=(0.2, 2.5), Delta=(-2.0, 2.0)), [arch.max_curvature <= 20]
    eset = em.equilibrium_set(arch, box, fixed={"q": 2.5}, within=within, intervals=(5, 9))
    with TemporaryDirectory() as folder:
        em.explore(eset, {}, Path(folder) / "page.html")
        em.plotting.surface(eset).figure.savefig(Path(folder) / "set.png")
    Dispatcher._compile_for_args = compile_here
    return by_spring | {each for each in made if each[0].startswith(OF_SETS)}


def text(types: tuple[object, ...]) -> str:
    """Types as numba reads them."""
    plain = ARRAY.sub(lambda found: f"{found[1]}[{':, ' * (int(found[2]) - 1)}::1]", repr(types))
    return re.sub(r"\bbool\b", "boolean", plain)


if __name__ == "__main__":
    main()
