"""The command ``run``: validate, compute, write."""

import argparse
import platform
from collections.abc import Mapping
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
_PICTURES = *results.PICTURES, *results.CURVES


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
        case = built(file, default=default_laws(tables))
        export = PartExport.read(file.output)
        checkpoint = _checkpoint(options.out, options.checkpoint, options.resume)
        if file.stepping.tolerance is None:
            stepper: Stepper = case.stepper(checkpoint)
        else:
            stepper = _to_tolerance(file, case, checkpoint)
        written = WrittenCase(file)
        named = file.output.test_curve
        test = None if named is None else read_test_curve(named)
        sampling = _sampling(file, case, written, options)
        refuse_foreign_case(options.out)
        fields = (f"fields/{name}" for name in io.FIELDS)
        numbers = ("summary.json", "history.csv", CURVE, SAMPLES, PHASES)
        export.refuse_folder(options.out)
        drapes = *io.DRAPED, *PartExport.all_files, *decks_in(options.out)
        files = (*numbers, *WRITTEN_FILES, *drapes, *fields, *_PICTURES, REPORT)
        out = ResultFolder(options.out, files)
        begin = _begin(case, options)
        code, message, refusal = _load(stepper, begin)
    result = stepper.result
    described = case.described(result)
    provenance = {
        "inputs": {"version": __version__, **tables_of(file)},
        "versions": versions(),
    }
    # The error interval may take long, and be interrupted.
    before = replace(result, interval=lambda _: ErrorInterval(reason="interrupted"))
    curve: Curve = curve_of(case.scene, before)
    summary = case.summary(before) | provenance
    exported: dict[str, Any] = {}
    complete = False
    try:
        with held():
            with out as folder:
                if export:
                    sheet = Sheet.of_ply(result.ply, described.u, case.scene.axes)
                    early = result.not_on_tool or "the run stopped early"
                    reason = "" if result.converged else early
                    exported = export.write(sheet, reason, folder)
                summary = export.added(summary, exported)
                io.write_summary(summary, folder / "summary.json")
                of_run = case.scene.axes, case.scene.process
                io.write_history(result, folder / "history.csv", *of_run)
                if case.scene.process:
                    io.write_phases(result, folder / PHASES, case.scene.process)
                write_curve(curve, folder / CURVE)
                written.write(folder)
                io.write_fields(result, folder / "fields", case.scene.axes)
                if not result.not_on_tool:
                    io.write_draped(described, folder, case.scene.axes)
            complete = True
        if code != INTERRUPTED:
            # Include the error interval.
            with shown("estimating the error", printed=True):
                summary = export.added(case.summary(result) | provenance, exported)
                curve = curve_of(case.scene, result)
            _write_again(summary, curve, options)
            if sampling:
                code, message, summary, curve = _with_samples(
                    sampling, (code, message), summary, curve, result, options
                )
    except OutputError as error:
        raise OutputError(f"{error}; {_checkpoint_note(stepper)}") from None
    except KeyboardInterrupt:
        if not complete:
            raise
        code, message = (
            INTERRUPTED,
            "interrupted: the results computed so far are written",
        )
    if (
        case.pictures
        and code != INTERRUPTED
        and not _draw(case, refusal or result, curve, test, options)
    ):
        code = INTERRUPTED
    if code == 0 and (missing := export.missing(exported)):
        code, message = STOPPED_EARLY, "; ".join(missing)
    if options.json:
        say((options.out / "summary.json").read_text(encoding="utf-8"), end="")
    else:
        say_rows(first_rows(summary))
        written_to = f"results written to {printable(options.out)}"
        say(f"{written_to}: all values in summary.json{out.removed_text()}")
    if message:
        complain(message)
    return code


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
