"""The command ``run``: validate, compute, write."""

import argparse
import platform
from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import msgspec
import numpy as np

from .. import __version__, io
from ..cases.build import built
from ..cases.read import CaseFile, declared, default_laws
from ..cases.write import WRITTEN_FILES, WrittenCase, refuse_foreign_case, tables_of
from ..mesh.progress import log_to_stderr, shown
from ..mesh.user_input import printable
from ..nets.sheet import Sheet
from ..scenes.scene import Case
from ..solve.interval import ErrorInterval
from ..solve.quantities import first_rows
from ..solve.result import Result, StepError
from ..solve.stepper import LoadStepper
from ..solve.tolerance import ToleranceStepper
from . import results
from .curve import CURVE, Curve, curve_of, read_test_curve, write_curve
from .export import PartExport, decks_in
from .interruption import INTERRUPTED, held
from .output import STOPPED_EARLY, OutputError, complain, say
from .page import say_rows
from .report import PHASES, REPORT, SAMPLES
from .result_folder import ResultFolder
from .run_options import with_tables

if TYPE_CHECKING:
    from .samples import Sampling

#: Either load stepper of a run.
Stepper: TypeAlias = LoadStepper | ToleranceStepper

# All pictures that a run may draw.
_PICTURES = *results.PICTURES, *results.CURVES, results.OF_PLIES


def run(options: argparse.Namespace) -> int:
    """Run a scene or a case file and write its results; returns the exit code.

    Raises
    ------
    ValueError
        If the case cannot be run.
    OutputError
        If the results cannot be written.
    """
    return with_tables(options, partial(_run, options=options))


@np.errstate(over="ignore", invalid="ignore")  # results that are not finite are refused
def _run(tables: Mapping[str, Any], base: Path, options: argparse.Namespace) -> int:
    """Run the case of tables with files in a folder; returns the exit code."""
    file = declared(tables, base)
    if options.no_render:
        file = msgspec.structs.replace(
            file, output=msgspec.structs.replace(file.output, pictures=False)
        )
    log_to_stderr(options.verbose)
    with shown("preparing the case", printed=True):
        run = _Run(file, default_laws(tables), options)
        run.apply()
    try:
        run.write()
        if run.code != INTERRUPTED:
            run.complete()
    except OutputError as error:
        raise OutputError(f"{error}; {_checkpoint_note(run.stepper)}") from None
    except KeyboardInterrupt:
        if not run.is_written:
            raise
        run.code = INTERRUPTED
        run.message = "interrupted: the results computed so far are written"
    run.draw()
    run.say()
    return run.code


class _Run:
    """Run of a case: everything is validated before it is applied.

    ``code`` is the exit code and ``message`` the final message.
    """

    def __init__(
        self, file: CaseFile, default: Collection[str], options: argparse.Namespace
    ) -> None:
        self.options, self.code, self.message = options, 0, ""
        self.refusal: StepError | None = None
        self.is_written, self._exported = False, dict[str, Any]()
        self.case = case = built(file, default=default)
        self.export = PartExport.read(file.output)
        checkpoint = _checkpoint(options.out, options.checkpoint, options.resume)
        self.stepper: Stepper
        if file.stepping.tolerance is None:
            self.stepper = case.stepper(checkpoint)
        else:
            self.stepper = _to_tolerance(file, case, checkpoint)
        self._case_file = WrittenCase(file)
        named = file.output.test_curve
        self._test = None if named is None else read_test_curve(named)
        self._sampling = _sampling(file, case, self._case_file, options)
        refuse_foreign_case(options.out)
        self.export.refuse_folder(options.out)
        self._out = ResultFolder(options.out, _files(options.out))
        self._begin = _begin(case, options)
        self._provenance = {
            "inputs": {"version": __version__, **tables_of(file)},
            "versions": versions(),
        }

    def apply(self) -> None:
        """Apply the load, until it is interrupted or a step fails."""
        self.code, self.message, self.refusal = _load(self.stepper, self._begin)
        self.result = self.stepper.result

    def write(self) -> None:
        """Write the results without the error interval, which may take long."""
        case, result, scene = self.case, self.result, self.case.scene
        described = case.described(result)
        no_error = ErrorInterval(reason="interrupted")
        before = replace(result, interval=lambda _: no_error)
        self.curve: Curve = curve_of(scene, before)
        summary = case.summary(before) | self._provenance
        with held():
            with self._out as folder:
                if self.export:
                    sheet = Sheet.of_ply(result.ply, described.u, scene.axes)
                    early = result.not_on_tool or "the run stopped early"
                    reason = "" if result.converged else early
                    self._exported = self.export.write(sheet, reason, folder)
                self.summary = self.export.added(summary, self._exported)
                io.write_summary(self.summary, folder / "summary.json")
                of_run = scene.axes, scene.process
                io.write_history(result, folder / "history.csv", *of_run)
                if scene.process:
                    io.write_phases(result, folder / PHASES, scene.process)
                write_curve(self.curve, folder / CURVE)
                self._case_file.write(folder)
                io.write_fields(result, folder / "fields", scene.axes)
                if not result.not_on_tool:
                    io.write_draped(described, folder, scene.axes)
            self.is_written = True

    def complete(self) -> None:
        """Estimate the error, run the samples of the fabric, and write again."""
        with shown("estimating the error", printed=True):
            summary = self.case.summary(self.result) | self._provenance
            self.summary = self.export.added(summary, self._exported)
            self.curve = curve_of(self.case.scene, self.result)
        _write_again(self.summary, self.curve, self.options)
        if self._sampling:
            self.code, self.message, self.summary, self.curve = _with_samples(
                *(self._sampling, (self.code, self.message), self.summary),
                *(self.curve, self.result, self.options),
            )

    def draw(self) -> None:
        """Draw the pictures."""
        if not self.case.pictures or self.code == INTERRUPTED:
            return
        run = self.refusal or self.result
        if not _draw(self.case, run, self.curve, self._test, self.options):
            self.code = INTERRUPTED

    def say(self) -> None:
        """Print the first quantities, or the summary, and the final message."""
        options = self.options
        if self.code == 0 and (missing := self.export.missing(self._exported)):
            self.code, self.message = STOPPED_EARLY, "; ".join(missing)
        if options.json:
            say((options.out / "summary.json").read_text(encoding="utf-8"), end="")
        else:
            say_rows(first_rows(self.summary))
            removed = self._out.removed_text()
            written_to = f"results written to {printable(options.out)}"
            say(f"{written_to}: all values in summary.json{removed}")
        if self.message:
            complain(self.message)


def _files(out: Path) -> tuple[str, ...]:
    """Files that a run may write."""
    fields = (f"fields/{name}" for name in io.FIELDS)
    numbers = ("summary.json", "history.csv", CURVE, SAMPLES, PHASES)
    drapes = *io.DRAPED, *PartExport.all_files, *decks_in(out)
    return (*numbers, *WRITTEN_FILES, *drapes, *fields, *_PICTURES, REPORT)


def _sampling(
    file: CaseFile, case: Case, written: WrittenCase, options: argparse.Namespace
) -> "Sampling | None":
    """Samples of the fabric that are to be run; None without."""
    if file.fabric.samples is not None:
        from .samples import Sampling

        return Sampling.of(file, case, written, options)
    for name in ("workers", "scheduler"):
        if getattr(options, name) is not None:
            raise ValueError(f"--{name} applies to --samples only: omit it")
    return None


def _with_samples(
    sampling: "Sampling",
    end: tuple[int, str],
    summary: dict[str, Any],
    curve: Curve,
    result: Result,
    options: argparse.Namespace,
) -> tuple[int, str, dict[str, Any], Curve]:
    """Run the samples: exit code, final message, and summary and curve with bands."""
    from .samples import curve_with_band, stopped_text, with_bands, write_samples

    code, message = end
    if code != 0:
        return code, f"{message}; no sample of the fabric is run", summary, curve
    try:
        samples = sampling.run(options.out)
    except ValueError as error:
        return STOPPED_EARLY, str(error), summary, curve
    except KeyboardInterrupt:
        text = "interrupted: completed samples are kept; the same command continues"
        return INTERRUPTED, text, summary, curve
    summary = with_bands(summary, samples)
    curve = curve_with_band(curve, result, samples)
    _write_again(summary, curve, options)
    with held(), ResultFolder(options.out, (SAMPLES,)) as folder:
        write_samples(samples, folder / SAMPLES)
    code = STOPPED_EARLY if samples.stopped else 0
    return code, stopped_text(samples), summary, curve


def _begin(case: Case, options: argparse.Namespace) -> dict[str, Any]:
    """Where a run begins, as arguments of its load stepper; see ``--from``."""
    folder, phase = options.states_of, options.phase
    resume = options.resume is not None
    if folder is None and phase is None:
        return {"resume": resume}
    if folder is None or phase is None:
        raise ValueError(
            "--from and --phase belong together: name the folder of the other run, and "
            "the phase with which this one begins"
        )
    process = case.scene.process
    if process is None:
        raise ValueError("--from requires a case with [[phases]]")
    if resume:
        raise ValueError(
            "--resume continues the run in its own folder: omit --from and --phase"
        )
    if not folder.is_dir():
        raise ValueError(f"--from {printable(folder)}: there is no such folder")
    if folder.resolve() == options.out.resolve():
        raise ValueError("--from and --out name the same folder: choose another --out")
    until = process.begin(phase)
    found = [x for x in (folder, folder / "checkpoint") if (x / "run.npz").is_file()]
    if not found:
        raise ValueError(
            f"{printable(folder)} contains no checkpoint: run its case with "
            "--checkpoint first"
        )
    return {"states_of": found[0], "until": until}


def _load(
    stepper: Stepper, begin: Mapping[str, Any]
) -> tuple[int, str, StepError | None]:
    """Run a load stepper: exit code, final message, and the error that stopped it."""
    try:
        stepper.run(**begin)
    except StepError as error:
        return STOPPED_EARLY, str(error), error
    except KeyboardInterrupt:
        if not stepper.states:
            raise
        return INTERRUPTED, _interruption(stepper), None
    return 0, "", None


def _interruption(stepper: Stepper) -> str:
    at = stepper.states[-1].load_factor
    if hasattr(stepper, "tolerance"):
        return (
            "interrupted before the tolerance was met: the last converged state, "
            f"at load factor {at:.6g}, is written"
        )
    kept, lost = (
        "--resume continues the run from there",
        "only a run with --checkpoint can be resumed",
    )
    advice = kept if stepper.checkpoint else lost
    written = f"the last converged state, at load factor {at:.6g}, is written"
    return f"interrupted: {stepper.result.not_on_tool or written}; {advice}"


def versions() -> dict[str, str]:
    """Versions of the packages that a run uses."""
    packages = "numpy", "scipy", "scikit-fem"
    return {
        "skfem-textile": __version__,
        "Python": platform.python_version(),
        **{package: metadata.version(package) for package in packages},
        "system": f"{platform.system()} {platform.machine()}",
    }


def _to_tolerance(
    file: CaseFile, case: Case, checkpoint: Path | None
) -> ToleranceStepper:
    """Load stepper on finer and finer meshes of a case.

    Raises
    ------
    ValueError
        As for the stepper, or if there is a checkpoint.
    """
    tolerance = file.stepping.tolerance
    if checkpoint or tolerance is None:
        raise ValueError(
            "a run with stepping.tolerance cannot write checkpoints: omit "
            "stepping.tolerance, or omit --checkpoint and --resume"
        )
    return ToleranceStepper(
        lambda density: (case if density == 1 else built(file, density)).stepper(),
        tolerance,
        most_unknowns=file.stepping.most_unknowns,
    )


def _write_again(
    summary: Mapping[str, Any], curve: Curve, options: argparse.Namespace
) -> None:
    """Replace summary and curve without an error interval, if possible."""
    try:
        with held(), ResultFolder(options.out, ("summary.json", CURVE)) as folder:
            io.write_summary(summary, folder / "summary.json")
            write_curve(curve, folder / CURVE)
    except OSError as error:
        _note(f"the error interval was not written: {printable(error)}", options)


def _note(text: str, options: argparse.Namespace) -> None:
    """Print a note; to stderr if stdout is for JSON."""
    (complain if options.json else say)(text)


def _draw(
    case: Case,
    run: Result | StepError,
    curve: Curve,
    test: Curve | None,
    options: argparse.Namespace,
) -> bool:
    """Draw pictures, or print the reason why not; False after an interruption.

    The numbers are already written.
    """
    try:
        with (
            ResultFolder(options.out, _PICTURES) as folder,
            shown("drawing pictures", printed=True),
        ):
            results.draw(case, run, curve, test, folder)
    except Exception as error:
        _note(f"the pictures were not drawn: {printable(error)}", options)
    except KeyboardInterrupt:
        complain("interrupted: the numerical results are written, the pictures are not")
        return False
    return True


def _checkpoint(
    out: Path, checkpoint: Path | bool | None, resume: Path | bool | None
) -> Path | None:
    """Folder of --checkpoint or --resume, by default within the output folder."""
    named = {folder for folder in (checkpoint, resume) if isinstance(folder, Path)}
    if len(named) > 1:
        raise ValueError(
            "--checkpoint and --resume name different folders: use one folder"
        )
    if checkpoint is None and resume is None:
        return None
    return named.pop() if named else out / "checkpoint"


def _checkpoint_note(stepper: Stepper) -> str:
    """Message on the checkpoint of a run whose results cannot be written."""
    if stepper.checkpoint is None:
        return "the run cannot be resumed, because --checkpoint was not given"
    kept = stepper.checkpoint.folder
    return f"the checkpoint {kept} remains: resume the run with --resume"
