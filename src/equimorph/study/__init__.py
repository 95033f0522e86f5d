"""Studies: a problem file in, results and a report out."""

from equimorph.study.complaint import StudyError, lines_of
from equimorph.study.memory import check_memory
from equimorph.study.prepare import Answered, Outcome, Problem, prepare
from equimorph.study.problem import Study, parse_study, read_study_text
from equimorph.study.report import summary
from equimorph.study.run import read_problem, run_study

__all__ = [
    "Answered",
    "Outcome",
    "Problem",
    "Study",
    "StudyError",
    "check_memory",
    "lines_of",
    "parse_study",
    "prepare",
    "read_problem",
    "read_study_text",
    "run_study",
    "summary",
]
