"""The results folder of a study: ours alone, never half-written, never someone else's.

A manifest lists the study and every file that was put there. Files are made in a hidden staging
folder and moved when complete; a file that the manifest does not list is never touched.
"""

import hashlib
import json
import shutil
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from equimorph.errors import InputError
from equimorph.storage.files import write_text
from equimorph.study.problem import Study

MANIFEST = "equimorph.json"
FORMAT = "equimorph results folder"
VERSION = 1
_STAGING = ".partial-"


@dataclass(frozen=True)
class ResultsFolder:
    """An open results folder.

    Parameters
    ----------
    path
        Where it is.
    study
        Digest of the study whose results it holds.
    """

    path: Path
    study: str

    @contextmanager
    def adding(self) -> Generator[Path]:
        """Give an empty staging folder; its files move here when the block succeeds.

        Raises
        ------
        InputError
            If the folder cannot be written, or holds a file of that name that is not ours.
        """
        with _writable(self.path):
            staging = Path(tempfile.mkdtemp(prefix=_STAGING, dir=self.path))
        try:
            yield staging
            with _writable(self.path):
                self._admit(sorted(staging.iterdir()))
        finally:
            shutil.rmtree(staging, ignore_errors=True)

    def add_text(self, name: str, text: str) -> None:
        """Put one text file here."""
        with self.adding() as staging:
            (staging / name).write_text(text, encoding="utf-8")

    def holds(self, name: str) -> bool:
        """Whether a file of that name is here and ours."""
        return name in self.files() and (self.path / name).is_file()

    def files(self) -> list[str]:
        """Names of our files."""
        names: list[str] = _read_manifest(self.path).get("files", [])
        return names

    def _admit(self, arrivals: list[Path]) -> None:
        known = self.files()
        for file in arrivals:
            if file.name not in known and (self.path / file.name).exists():
                raise InputError(
                    f"`results folder` must not hold a file of its own at {self.path / file.name}; "
                    "got one. Move it away, or choose another folder."
                )
        # Listed before they arrive: after an interruption they are still known to be ours.
        _write_manifest(self.path, self.study, sorted({*known, *(file.name for file in arrivals)}))
        for file in arrivals:
            file.replace(self.path / file.name)


def open_results_folder(path: Path, study: Study, *, fresh: bool = False) -> ResultsFolder:
    """Make a results folder, or open the one that an earlier run of the same study left.

    Parameters
    ----------
    path
        Where it is or shall be.
    study
        The study to be run.
    fresh
        Remove what an earlier run of any study left there; other files stay.

    Raises
    ------
    InputError
        If `path` cannot be a folder or be written, or holds other files or another study's results.
    """
    folder = ResultsFolder(path, study_digest(study))
    with _writable(path):
        path.mkdir(parents=True, exist_ok=True)
        manifest = _read_manifest(path)
        if fresh and manifest:
            _clear(path, manifest)
            manifest = {"study": folder.study, "files": []}
        _check_owner(path, manifest, folder.study)
        _write_manifest(path, folder.study, manifest.get("files", []))
    return folder


def study_digest(study: Study) -> str:
    """Fingerprint of what a study asks for; comments, order of keys and title do not count."""
    content = study.model_dump(mode="json", by_alias=True, exclude={"title"})
    words = json.dumps({**content, "version": version("equimorph")}, sort_keys=True)
    return hashlib.sha256(words.encode()).hexdigest()


@contextmanager
def _writable(path: Path) -> Generator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(
            f"`results folder` must be a folder that can be written; got {path}: {error.strerror}. "
            "Choose another one with --out."
        ) from error


def _check_owner(path: Path, manifest: dict[str, Any], study: str) -> None:
    if not manifest and any(not file.name.startswith(_STAGING) for file in path.iterdir()):
        raise InputError(
            f"`results folder` must be empty or hold earlier results of this study; got {path} "
            "with other files. Choose another one with --out."
        )
    if manifest and manifest.get("study") != study:
        raise InputError(
            f"`results folder` must be empty or hold earlier results of this study; got {path} "
            "with the results of another study, another version of this one, or another release. "
            "Choose another one with --out, or replace them with --fresh."
        )


def _clear(path: Path, manifest: dict[str, Any]) -> None:
    for name in manifest["files"]:
        (path / name).unlink(missing_ok=True)
    for staging in path.glob(f"{_STAGING}*"):
        shutil.rmtree(staging, ignore_errors=True)
    (path / MANIFEST).unlink()


def _read_manifest(path: Path) -> dict[str, Any]:
    """Manifest of a folder, empty if there is none.

    Names with a folder in them are refused: a manifest never makes us touch a file elsewhere.
    """
    file = path / MANIFEST
    if not file.exists():
        return {}
    try:
        manifest = json.loads(file.read_text(encoding="utf-8"))
        sound = manifest["format"] == FORMAT and manifest["version"] <= VERSION
        sound = sound and all(Path(name).name == name for name in manifest["files"])
    except (ValueError, KeyError, TypeError):
        sound = False
    if not sound:
        raise InputError(
            f"`results folder` must have a manifest of this release; got a damaged or newer "
            f"{file}. Choose another folder with --out."
        )
    return dict(manifest)


def _write_manifest(path: Path, study: str, files: list[str]) -> None:
    manifest = {"format": FORMAT, "version": VERSION, "study": study, "files": files}
    write_text(path / MANIFEST, json.dumps(manifest, indent=2) + "\n")
