"""The results folder of a study: ours alone, never half-written, never someone else's.

A manifest names the study and lists every file that was put there with its checksum. Files are made
in a hidden folder of ours and moved when complete; a file that the manifest does not list is never
touched. While a run has the folder open, no other one has.
"""

import errno
import json
import shutil
import tempfile
from collections.abc import Generator, Iterable
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from equimorph.errors import InputError
from equimorph.storage.files import FINGERPRINT, checksum, fingerprint, lock_file, move_whole
from equimorph.study.problem import Study

MANIFEST = "equimorph.json"
PRIVATE = ".equimorph"
FORMAT = "equimorph results folder"
VERSION = 2
"""Version of the layout of results folders; older ones are read."""
_CHECKPOINTS, _LOCK, _STAGING = "checkpoints", "lock", "staging-"
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@dataclass(frozen=True)
class ResultsFolder:
    """An open results folder."""

    path: Path
    """Where it is."""
    study: str
    """Fingerprint of the study whose results it holds."""

    @property
    def checkpoints(self) -> Path:
        """Folder for the answers to go on from."""
        return self.path / PRIVATE / _CHECKPOINTS

    @contextmanager
    def adding(self) -> Generator[Path]:
        """Give an empty staging folder; its files move here when the block succeeds.

        Refused if the folder cannot be written, or holds a file of that name that is not ours.
        """
        with writable(self.path):
            staging = Path(tempfile.mkdtemp(prefix=_STAGING, dir=self.path / PRIVATE))
            try:
                yield staging
                self._admit(sorted(staging.iterdir()))
            finally:
                shutil.rmtree(staging, ignore_errors=True)

    def holds(self, names: Iterable[str]) -> bool:
        """Whether all files of these names are here, ours, and as they were written."""
        files = self.files()
        return all(
            name in files
            and (self.path / name).is_file()
            and checksum((self.path / name).read_bytes()) == files[name]
            for name in names
        )

    def files(self) -> dict[str, str]:
        """Names of our files with their checksums."""
        return dict(_read_manifest(self.path).get("files", {}))

    def _admit(self, arrivals: list[Path]) -> None:
        known = self.files()
        for file in arrivals:
            if file.name not in known and (self.path / file.name).exists():
                raise InputError(
                    f"`results folder` must not hold a foreign file at {self.path / file.name}; "
                    "got one. Move it away, or choose another folder."
                )
        # Listed before they arrive: after an interruption they are still known to be ours.
        new = {file.name: checksum(file.read_bytes()) for file in arrivals}
        _write_manifest(self.path, self.study, {**known, **new})
        for file in arrivals:
            move_whole(file, self.path / file.name)


@contextmanager
def open_results_folder(
    path: Path, study: Study, *, replace: bool = False
) -> Generator[ResultsFolder]:
    """Make a results folder, or open the one that an earlier run of the same study left.

    Parameters
    ----------
    path
        Where it is or shall be.
    study
        The study to be run.
    replace
        Take over a folder with the results of another study: its files are removed, but not the
        answers to questions that both studies ask. Files of other origin stay.

    Raises
    ------
    InputError
        If `path` cannot be a folder or be written, is in use by another run, or holds other files
        or another study's results.
    """
    folder = ResultsFolder(path, study_fingerprint(study))
    with ExitStack() as held:
        with writable(path):
            path.mkdir(parents=True, exist_ok=True)
            _check_owner(path, folder.study, replace=replace)
            folder.checkpoints.mkdir(parents=True, exist_ok=True)
            held.enter_context(lock_file(path / PRIVATE / _LOCK, f"results folder {path}"))
            _check_owner(path, folder.study, replace=replace)
            _sweep(path)
            _clear_other(path, folder.study)
        yield folder


def study_fingerprint(study: Study) -> str:
    """Fingerprint of what a study asks for; comments, order of keys and the title do not count."""
    whole = study.model_dump(mode="json", by_alias=True, exclude={"title"})
    return fingerprint({**whole, "version": version("equimorph")})


@contextmanager
def writable(path: Path) -> Generator[None]:
    """Say in one line that a results folder cannot be written, and what to do."""
    try:
        yield
    except OSError as error:
        blocked = isinstance(error, FileExistsError | NotADirectoryError)
        reason = "a file is in its place" if blocked else error.strerror or str(error)
        if error.errno in _FULL:
            raise InputError(
                f"`results folder` must have room for the results; got {path}: {reason}. What is "
                "finished is kept: free some space and run again."
            ) from error
        raise InputError(
            f"`results folder` must be a folder that can be written; got {path}: {reason}. "
            "Choose another one with --out."
        ) from error


def _check_owner(path: Path, study: str, *, replace: bool) -> None:
    manifest = _read_manifest(path)
    if not manifest and any(file.name != PRIVATE for file in path.iterdir()):
        raise InputError(
            f"`results folder` must be empty or hold earlier results of this study; got {path} "
            "with other files. Choose another one with --out."
        )
    if manifest and manifest["study"] != study and not replace:
        raise InputError(
            f"`results folder` must be empty or hold earlier results of this study; got {path} "
            "with the results of another study, or of another version of this one. "
            "Choose another one with --out, or replace them with --replace."
        )


def _clear_other(path: Path, study: str) -> None:
    """Remove the files of another study, then take the folder over."""
    manifest = _read_manifest(path)
    if manifest and manifest["study"] != study:
        for name in manifest["files"]:
            (path / name).unlink(missing_ok=True)
        _write_manifest(path, study, {})


def _sweep(path: Path) -> None:
    """Remove what runs that were killed had not finished."""
    for staging in (path / PRIVATE).glob(f"{_STAGING}*"):
        shutil.rmtree(staging, ignore_errors=True)


def _read_manifest(path: Path) -> dict[str, Any]:
    """Manifest of a folder, empty if the folder has none.

    Names with a folder in them are refused: a manifest never makes us touch a file elsewhere.
    """
    file = path / MANIFEST
    if not file.exists():
        return {}
    try:
        manifest = json.loads(file.read_text(encoding="utf-8"))
        sound = manifest["format"] == FORMAT and 1 <= manifest["version"] <= VERSION
        if manifest["version"] == 1:  # no checksums: every file is written again
            manifest["files"] = dict.fromkeys(manifest["files"], "")
            manifest["study"] = manifest["study"]["study"][:FINGERPRINT]
        sound = sound and isinstance(manifest["study"], str)
        sound = sound and all(Path(name).name == name for name in dict(manifest["files"]))
    except (ValueError, KeyError, TypeError):
        sound = False
    if not sound:
        raise InputError(
            f"`results folder` must have a manifest of this release; got a damaged or newer "
            f"{file}. Choose another folder with --out."
        )
    return dict(manifest)


def _write_manifest(path: Path, study: str, files: dict[str, str]) -> None:
    manifest = {"format": FORMAT, "version": VERSION, "study": study, "files": files}
    partial = path / PRIVATE / MANIFEST
    partial.write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")
    move_whole(partial, path / MANIFEST)
