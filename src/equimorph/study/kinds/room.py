"""Room around a state: ``[[room]]``."""

from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path
from types import MappingProxyType

from rich.markup import escape as plain

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.structures import State
from equimorph.study import html
from equimorph.study.answers import heading
from equimorph.study.question import Arguments, Figure, Kind, Question, still
from equimorph.tasks import Room, stable_room


class RoomKind(Kind[tuple[State, Room]]):
    """How far parameters may stray from a state."""

    table = "room"
    tasks = (stable_room,)
    names = MappingProxyType({"states": "state"})

    def answer(self, question: Question, arguments: Arguments) -> tuple[State, Room]:
        """Lift rays from the state."""
        return arguments["states"], stable_room(**arguments.of(stable_room))

    def figures(
        self, question: Question, eset: EquilibriumSet | None, answer: tuple[State, Room]
    ) -> Sequence[Figure]:
        """Where it lies, over two parameters."""
        if len(question.section.tolerances) != 2:
            return []
        draw = partial(plotting.room, *answer, eset)
        return [still(question.files, draw)]

    def report(self, question: Question, answer: tuple[State, Room], folder: Path) -> list[str]:
        """Its sides, and what bounds it."""
        _, room = answer
        box, files = room.boxes[0], question.files
        rows = [
            [escape(name), html.number(low, 6), html.number(high, 6)]
            for name, low, high in zip(box.names, box.lower, box.upper, strict=True)
        ]
        caption = "The room around the state (●) and where it ends (×)."
        return [
            heading(question),
            f"<p>{escape(_room_in_words(question, room))}</p>",
            html.table(["", "from", "to"], rows),
            html.pictures(folder, {}, {f"{files}.png": caption}),
        ]

    def verdict(self, question: Question, answer: tuple[State, Room]) -> str:
        """Its size."""
        return f"{question.title}: {plain(_room_in_words(question, answer[1]))}"


def _room_in_words(question: Question, room: Room) -> str:
    stable = f"the {question.section.shape} of {html.number(room.least, 6)} tolerances"
    if room.kind[0] == "arrived":
        return f"{stable} is stable, the largest that was tried."
    return f"stable up to {stable}; then {room.kind[0]}."
