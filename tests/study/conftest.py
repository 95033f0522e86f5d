"""A small spring study, run once into a folder."""

from functools import partial
from pathlib import Path

import pytest

from equimorph import plotting
from equimorph.study import Outcome, run_study
from studies import ARCH, SPRING, draw_dots


@pytest.fixture(scope="session")
def spring_text() -> str:
    return SPRING


@pytest.fixture(scope="session")
def arch_text() -> str:
    return ARCH


@pytest.fixture
def spring_file(tmp_path: Path) -> Path:
    path = tmp_path / "spring.toml"
    path.write_text(SPRING)
    return path


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Outcome, Path]:
    """The outcome of the spring study and its results folder; read them, change nothing."""
    base = tmp_path_factory.mktemp("finished")
    (base / "spring.toml").write_text(SPRING)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plotting, "film", partial(plotting.film, frames=12))
        return run_study(base / "spring.toml", base / "out"), base / "out"


@pytest.fixture
def plain_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    draw_dots(monkeypatch)
