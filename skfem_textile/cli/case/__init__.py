"""Cases on the command line and in files: what they may say, and what it builds."""

from .file import CaseFileError
from .from_python import case_from_file, case_from_tables

__all__ = ["CaseFileError", "case_from_file", "case_from_tables"]
