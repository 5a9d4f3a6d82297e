"""Cases: declaration of a problem, and its construction."""

from .build import built, case_from_file, case_from_tables
from .read import CaseFileError, declared, read_tables
from .scenes import SCENES
from .schema import CaseFile

__all__ = [
    "SCENES",
    "CaseFile",
    "CaseFileError",
    "built",
    "case_from_file",
    "case_from_tables",
    "declared",
    "read_tables",
]
