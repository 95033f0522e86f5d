"""The results folder of a study: ours alone, never half-written, never someone else's.

A manifest names the study and lists every file that was put there. Files are made in a hidden
staging folder and moved when complete; a file that the manifest does not list is never touched.
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
from time import time
from typing import Any

from equimorph.errors import InputError
from equimorph.storage.files import write_text
from equimorph.study.problem import Study

MANIFEST = "equimorph.json"
RESULTS = "results.h5"
FORMAT = "equimorph results folder"
VERSION = 1
_STAGING = ".partial-"
_ABANDONED = 3600.0
"""Age in seconds after which a staging folder is taken for one of a killed run."""


@dataclass(frozen=True)
class ResultsFolder:
    """An open results folder.

    Parameters
    ----------
    path
        Where it is.
    study
        Digests of the study whose results it holds.
    """

    path: Path
    study: dict[str, str]

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


def open_results_folder(path: Path, study: Study, *, replace: bool = False) -> ResultsFolder:
    """Make a results folder, or open the one that an earlier run of the same study left.

    Parameters
    ----------
    path
        Where it is or shall be.
    study
        The study to be run.
    replace
        Take over a folder with the results of another study: its files are removed, except the
        equilibrium set if both studies ask for the same one. Files of others stay.

    Raises
    ------
    InputError
        If `path` cannot be a folder or be written, or holds other files or another study's results.
    """
    folder = ResultsFolder(path, study_digests(study))
    with _writable(path):
        path.mkdir(parents=True, exist_ok=True)
        manifest = _read_manifest(path)
        if replace and manifest:
            manifest = _cleared(path, manifest, folder.study)
        _check_owner(path, manifest, folder.study)
        _sweep(path)
        _write_manifest(path, folder.study, manifest.get("files", []))
    return folder


def study_digests(study: Study) -> dict[str, str]:
    """Fingerprints of what a study asks for, as a whole and of its set.

    Comments, the order of keys and the title do not count.
    """
    whole = study.model_dump(mode="json", by_alias=True, exclude={"title"})
    whole["version"] = version("equimorph")
    part = {key: whole[key] for key in ("structure", "set", "version")}
    return {"study": _digest(whole), "set": _digest(part)}


def _digest(content: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


@contextmanager
def _writable(path: Path) -> Generator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(
            f"`results folder` must be a folder that can be written; got {path}: {error.strerror}. "
            "Choose another one with --out."
        ) from error


def _check_owner(path: Path, manifest: dict[str, Any], study: dict[str, str]) -> None:
    if not manifest and any(not file.name.startswith(_STAGING) for file in path.iterdir()):
        raise InputError(
            f"`results folder` must be empty or hold earlier results of this study; got {path} "
            "with other files. Choose another one with --out."
        )
    if manifest and manifest["study"] != study:
        raise InputError(
            f"`results folder` must be empty or hold earlier results of this study; got {path} "
            "with the results of another study, or of another version of this one. "
            "Choose another one with --out, or replace them with --replace."
        )


def _cleared(path: Path, manifest: dict[str, Any], study: dict[str, str]) -> dict[str, Any]:
    """Remove what does not belong to a study; the manifest of what is left."""
    same_set = manifest["study"].get("set") == study["set"]
    kept = [name for name in manifest["files"] if same_set and name == RESULTS]
    for name in set(manifest["files"]) - set(kept):
        (path / name).unlink(missing_ok=True)
    return {"study": study, "files": kept}


def _sweep(path: Path) -> None:
    """Remove staging folders of runs that were killed; living ones are seconds old."""
    for staging in path.glob(f"{_STAGING}*"):
        if time() - staging.stat().st_mtime > _ABANDONED:
            shutil.rmtree(staging, ignore_errors=True)


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
        sound = sound and isinstance(manifest["study"], dict)
        sound = sound and all(Path(name).name == name for name in manifest["files"])
    except (ValueError, KeyError, TypeError):
        sound = False
    if not sound:
        raise InputError(
            f"`results folder` must have a manifest of this release; got a damaged or newer "
            f"{file}. Choose another folder with --out."
        )
    return dict(manifest)


def _write_manifest(path: Path, study: dict[str, str], files: list[str]) -> None:
    manifest = {"format": FORMAT, "version": VERSION, "study": study, "files": files}
    write_text(path / MANIFEST, json.dumps(manifest, indent=2) + "\n")
