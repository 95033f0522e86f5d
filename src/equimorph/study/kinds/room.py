"""Room around a state: ``[[room]]``."""

from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path

from rich.markup import escape as plain

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.model import Progress
from equimorph.structures import State
from equimorph.study import html
from equimorph.study.kinds.found import heading
from equimorph.study.kinds.kind import Figure, Kind, still
from equimorph.study.kinds.of_state import OfState, of_state
from equimorph.study.lookup import Ground, at_key
from equimorph.study.names import task_files
from equimorph.study.sections.robustness import RoomSection
from equimorph.tasks import Room, stable_room

RoomTask = OfState[RoomSection]


class RoomKind(Kind[RoomSection, RoomTask, tuple[State, Room]]):
    """How far parameters may stray from a state."""

    table = "room"

    def prepared(self, ground: Ground, section: RoomSection, key: str) -> RoomTask:
        """Look up state, tolerances and constraints."""
        return of_state(ground, section, key, tolerances=section.tolerances)

    def answer(
        self, ground: Ground, eset: EquilibriumSet | None, task: RoomTask, sink: Progress
    ) -> tuple[State, Room]:
        """Lift rays."""
        section, state = task.section, task.state(eset)
        with at_key(task.key):
            found = stable_room(
                state, section.tolerances, shape=section.shape, within=task.constraints,
                most=section.most,
            )  # fmt: skip
        return state, found

    def figures(
        self,
        ground: Ground,
        eset: EquilibriumSet | None,
        task: RoomTask,
        answer: tuple[State, Room],
    ) -> Sequence[Figure]:
        """Where it lies, over two parameters."""
        if len(task.section.tolerances) != 2:
            return []
        draw = partial(plotting.room, *answer, eset)
        return [still(task_files(self.table, task.section.name), draw)]

    def report(self, task: RoomTask, answer: tuple[State, Room], folder: Path) -> list[str]:
        """Its sides, and what bounds it."""
        _, room = answer
        box, files = room.boxes[0], task_files(self.table, task.section.name)
        rows = [
            [escape(name), html.number(low, 6), html.number(high, 6)]
            for name, low, high in zip(box.names, box.lower, box.upper, strict=True)
        ]
        caption = "The room around the state (●) and where it ends (×)."
        return [
            heading(self.table, task.section.name),
            f"<p>{escape(_room_in_words(task, room))}</p>",
            html.table(["", "from", "to"], rows),
            html.pictures(folder, {}, {f"{files}.png": caption}),
        ]

    def verdict(self, task: RoomTask, answer: tuple[State, Room]) -> str:
        """Its size."""
        return f"Room {task.section.name}: {plain(_room_in_words(task, answer[1]))}"


def _room_in_words(task: RoomTask, room: Room) -> str:
    stable = f"the {task.section.shape} of {html.number(room.least, 6)} tolerances"
    if room.kind[0] == "arrived":
        return f"{stable} is stable, the largest that was tried."
    return f"stable up to {stable}; then {room.kind[0]}."
