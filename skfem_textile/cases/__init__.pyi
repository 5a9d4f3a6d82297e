"""Public names, which the package imports on first use."""

from .build import (
    built as built,
    case_from_file as case_from_file,
    case_from_tables as case_from_tables,
)
from .finished import (
    FinishedRun as FinishedRun,
    read_result as read_result,
)
from .read import (
    CaseFile as CaseFile,
    CaseFileError as CaseFileError,
    declared as declared,
    read_tables as read_tables,
)
from .scenes import SCENES as SCENES
from .sweep import (
    CaseSweep as CaseSweep,
    sweep_case as sweep_case,
)
