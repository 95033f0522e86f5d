"""A small spring study, run once into a folder."""

from pathlib import Path

import pytest

from equimorph.study import Outcome
from studies import ARCH, SPRING, draw_dots, with_answers_of


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


@pytest.fixture
def out(finished: tuple[Outcome, Path], tmp_path: Path) -> Path:
    """A results folder in which a run was interrupted before it stored anything but answers."""
    return with_answers_of(finished[1], tmp_path / "out")


@pytest.fixture
def plain_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    draw_dots(monkeypatch)
