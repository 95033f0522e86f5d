"""Studies: a problem file in, results and a report out."""

from equimorph.study.complaint import StudyError as StudyError, lines_of as lines_of
from equimorph.study.memory import check_memory as check_memory
from equimorph.study.prepare import (
    Answered as Answered,
    Outcome as Outcome,
    Problem as Problem,
    prepare as prepare,
)
from equimorph.study.problem import (
    Study as Study,
    parse_study as parse_study,
    read_study_text as read_study_text,
)
from equimorph.study.report import summary as summary
from equimorph.study.run import read_problem as read_problem, run_study as run_study
