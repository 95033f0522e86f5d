"""Room around a state: ``[[room]]``."""

from functools import partial
from html import escape
from types import MappingProxyType

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.structures import State
from equimorph.study import html
from equimorph.study.question import Arguments, Figure, Kind, Question, still
from equimorph.tasks.robustness.room import Room, stable_room


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
    ) -> list[Figure]:
        """Where it lies, over two parameters."""
        draw = partial(plotting.room, *answer, eset)
        caption = "The room around the state (●) and where it ends (×)."
        two = len(question.section.tolerances) == 2
        return [still(question.files, draw, caption)] if two else []

    def words(self, question: Question, answer: tuple[State, Room]) -> str:
        """Its size."""
        room = answer[1]
        size = f"the {question.section.shape} of {html.number(room.least, 6)} tolerances"
        if room.kind[0] == "arrived":
            return f"{size} is stable, the largest that was tried."
        return f"stable up to {size}; then {room.kind[0]}."

    def details(self, question: Question, answer: tuple[State, Room]) -> list[str]:
        """Its sides."""
        box = answer[1].boxes[0]
        rows = [
            [escape(name), html.number(low, 6), html.number(high, 6)]
            for name, low, high in zip(box.names, box.lower, box.upper, strict=True)
        ]
        return [html.table(["", "from", "to"], rows)]
