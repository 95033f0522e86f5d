"""What is handed out: one version everywhere, and a wheel that works where only it is installed."""

import math
import re
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

import equimorph as em

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
USE = """
import equimorph as em, sys
assert em.__file__.startswith(sys.prefix), em.__file__
assert "jaxtyping" not in sys.modules
states = em.find_equilibria(em.Spring(), {"x_l": 0.8, "F": 0.0}).stable
print(abs(em.Spring().angle(states)[0]))
from equimorph.cli import main
sys.argv = ["equimorph", "new", "mine.toml"]
main()
"""


def test_the_version_is_the_same_everywhere():
    texts = {name: (ROOT / name).read_text(encoding="utf-8") for name in
             ("CITATION.cff", "CHANGELOG.md")}  # fmt: skip
    citation = re.search(r"^version: (.+)$", texts["CITATION.cff"], re.M)
    released = re.search(r"^## \[(\d.+?)\]", texts["CHANGELOG.md"], re.M)
    assert {em.__version__, citation[1], released[1]} == {PROJECT["version"]}


def test_extras_are_tested_in_development():
    """All but VTK, which takes 570 MB; its tests run where it is installed."""
    extras = PROJECT["optional-dependencies"]
    dev = {re.split(r"[<>=]", each)[0] for each in extras["dev"]}
    needed = {re.split(r"[<>=]", each)[0] for name in extras if name not in ("dev", "docs")
              for each in extras[name]}  # fmt: skip
    assert needed - dev == {"pyvista"}


@pytest.mark.slow
def test_wheel_and_source_work_in_a_fresh_environment(tmp_path: Path):
    """A study and equilibria (cos δ = x_l) from the wheel alone, and nothing is left out of it."""
    build = [sys.executable, "-m", "hatchling", "build", "-d", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,), (source,) = tmp_path.glob("*.whl"), tmp_path.glob("*.tar.gz")
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if name.startswith("equimorph/")}
    here = {
        str(file.relative_to(ROOT / "src"))
        for file in (ROOT / "src" / "equimorph").rglob("*")
        if file.is_file() and file.suffix not in (".pyc", ".nbc", ".nbi", ".lock")
    }
    assert packed == here
    with tarfile.open(source) as archive:
        assert any(name.endswith("/tests/test_packaging.py") for name in archive.getnames())
    venv.create(tmp_path / "env", with_pip=False)
    python = tmp_path / "env" / "bin" / "python"
    (site,) = (tmp_path / "env" / "lib").glob("python*/site-packages")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    ours = [each for each in sys.path if each.endswith("site-packages")]
    (site / "dependencies.pth").write_text("\n".join(ours))  # of wheels, but not of this package
    found = subprocess.run([python, "-c", USE], cwd=tmp_path, check=True, capture_output=True,
                           text=True, env={"PATH": ""})  # fmt: skip
    assert math.cos(float(found.stdout.split()[0])) == pytest.approx(0.8, abs=1e-9)
    assert (tmp_path / "mine.toml").exists()
