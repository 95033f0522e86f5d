"""Words of multistable structures: ``[[words]]``."""

from functools import partial

from equimorph import plotting
from equimorph.study import html
from equimorph.study.answers import count_of
from equimorph.study.question import Figure, Kind, Question, still
from equimorph.tasks.words.strokes import word_graph
from equimorph.tasks.words.word_graph import WordGraph


class WordsKind(Kind[WordGraph]):
    """Which words strokes of single parameters lead to from a state."""

    table = "words"
    tasks = (word_graph,)

    def figures(self, question: Question, answer: WordGraph) -> list[Figure]:
        """Words with the snaps between them."""
        caption = (
            "Words of stable states at rest, by the number of letters 1; arrows are strokes, each "
            "from one state at rest to the next, with its snaps."
        )
        return [still(question.files, partial(plotting.words, answer), caption)]

    def words(self, question: Question, answer: WordGraph) -> str:
        """Say how many are reached, and whether these are all."""
        reached = answer.reached(answer.words[0])
        found = [word for word, status in reached.items() if status == "reached"]
        first = answer.words[0]
        sure = "no others" if not any(answer.doubts) else "others were not found"
        return f"**{count_of(len(found), 'word')}** from {first}: {', '.join(found)}; {sure}."

    def details(self, question: Question, answer: WordGraph) -> list[str]:
        """The way to each word with the least work."""
        rows = []
        for word in answer.reached(answer.words[0]):
            route = answer.route(answer.words[0], word)
            strokes = ", ".join(f"{each.stroke} to {each.value:.6g}" for each in route.moves)
            rows.append([word, strokes or route.why, str(route.snaps), html.number(route.work)])
        return [html.table(["word", "strokes", "snaps", "work"], rows)]
