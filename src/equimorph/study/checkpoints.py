"""What a run has finished, answer by answer, to go on from after an interruption of any kind.

An answer's file is named after a fingerprint of its question and a checksum of its content. It is
found by asking the same question again, in this study or an edited one; a damaged file is not read.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, cast

from equimorph.errors import InputError
from equimorph.logs import log_of
from equimorph.storage.files import checksum, fingerprint, move_whole
from equimorph.storage.records import content_of, load_record
from equimorph.structures import Structure
from equimorph.study.folder import ResultsFolder, writable

LOG = log_of(__name__)
Answer = TypeVar("Answer")


@dataclass
class Checkpoints:
    """Answers in a hidden part of a results folder.

    Parameters
    ----------
    results
        The results folder, open.
    structure
        To which the answers belong.
    asked
        Fingerprints of the questions of this run so far.
    found
        Those whose answers were there already.
    """

    results: ResultsFolder
    structure: Structure
    asked: set[str] = field(default_factory=set)
    found: set[str] = field(default_factory=set)

    def answer(self, question: dict[str, Any], compute: Callable[[], Answer]) -> Answer:
        """Return the stored answer to a question; without one, compute it and store it.

        The answer is always the one read from the file, so that a run that was interrupted goes on
        from the very numbers that it would have had.

        Parameters
        ----------
        question
            All that the answer depends on, as plain data.
        compute
            Finds the answer.

        Raises
        ------
        InputError
            If the folder cannot be written.
        """
        key = fingerprint(question)
        self.asked.add(key)
        for file in self.results.checkpoints.glob(f"{key}-*"):
            found = self._load(file)
            if found is not None:
                self.found.add(key)
                LOG.info("answer %s read from an earlier run", file.name)
                (kept,) = found
                return cast(Answer, kept)
            file.unlink()
        file = self._store(key, content_of(compute()))
        return cast(Answer, load_record(file, self.structure))

    def forget_others(self) -> None:
        """Remove answers to questions that this run did not ask."""
        for file in self.results.checkpoints.iterdir():
            if file.name.partition("-")[0] not in self.asked:
                file.unlink()

    def _store(self, key: str, content: bytes) -> Path:
        file = self.results.checkpoints / f"{key}-{checksum(content)}"
        partial = self.results.checkpoints / "partial"
        with writable(self.results.path):
            partial.write_bytes(content)
            move_whole(partial, file)
        return file

    def _load(self, file: Path) -> tuple[Any] | None:
        """Return the answer in a file, unless it is damaged or of another release."""
        if not file.name.endswith(checksum(file.read_bytes())):
            return None
        try:
            return (load_record(file, self.structure),)
        except InputError:
            return None
