"""``dsa-des evidence``: run a case and leave the pack that shows what came of it."""

import sys
from pathlib import Path

from dsa_des.commands.study import (
    check_workers,
    choose_output_folder,
    exit_if_runs_crashed,
    require_empty_or_resumed,
    run_study_into_folder,
)
from dsa_des.errors import UsageError
from dsa_des.evidence.case import ASSESSED, read_case
from dsa_des.evidence.figures import draw_convergence, draw_sensitivity
from dsa_des.evidence.inputs import files_of_case
from dsa_des.evidence.pack import INPUTS, MACHINE, PAGE, STUDIES, Pack
from dsa_des.evidence.page import evidence_html
from dsa_des.files.output_file import write_file
from dsa_des.files.output_names import describe_write_error
from dsa_des.results.folder import StudyFolder
from dsa_des.results.tables import Tables
from dsa_des.scene.examples import find_input_file
from dsa_des.studies.runner import result_tables_of_study
from dsa_des.studies.study import portable_command_line
from dsa_des.terminal.terminal import say
from dsa_des.text.safe_text import shell_line

_HOME = Path("packs")


def evidence_command(
    case: str,
    out: str | None,
    sets: tuple[str, ...],
    encounters: int | None,
    workers: int | None,
    resume: bool,
) -> None:
    """Run a case's studies and write its evidence pack; exit with 1 if no verdict can be given."""
    check_workers(workers)
    if encounters is not None and encounters < 2:
        raise UsageError(f"--encounters is {encounters}: it must be 2 or more")
    path = find_input_file(case, "case")
    checked = read_case(path, sets, encounters)
    location = choose_output_folder(_HOME, path.stem, out, resume)
    require_empty_or_resumed(location, resume, "a pack")
    try:
        inputs = files_of_case(checked).contents_by_name()
    except OSError as error:
        raise UsageError(f"{error.filename}: cannot be read: {error.strerror}") from error
    target = location if isinstance(location, Path) else location()
    words = ["dsa-des", "evidence", "--resume", "--out", str(target)]
    words += [word for one in sets for word in ("--set", one)]
    many = ["--encounters", str(encounters)] if encounters else []
    again = shell_line([*words, *many, case])
    repeat = portable_command_line(["evidence", *many], sets, path)
    try:
        for name, content in inputs.items():
            _write_evidence_file(target / INPUTS / name, content)
    except OSError as error:
        why = describe_write_error(error, target)
        raise UsageError(f"--out {target}: cannot be written: {why}") from error
    folders: dict[str, StudyFolder] = {}
    tables: dict[str, Tables] = {}
    for name, study in checked.studies.items():
        study.repeat = repeat
        path = target / STUDIES / name
        folders[name] = run_study_into_folder(study, path, workers, resume, again)
        tables[name] = result_tables_of_study(study, folders[name])
        tables[name].write()
    pack = Pack(checked, folders, tables, sets, encounters)
    evidence = pack.evidence()
    settled = draw_convergence(pack.findings, tables[ASSESSED].record.confidence)
    changed = draw_sensitivity(pack.changes) if pack.changes else None
    _write_evidence_file(target / MACHINE, pack.evidence_json())
    _write_evidence_file(target / PAGE, evidence_html(evidence, settled, changed))
    say(pack.line, err=pack.passes is None)
    say(f"wrote {target / PAGE}")
    exit_if_runs_crashed(list(tables.values()), again)
    if pack.passes is None:
        sys.exit(1)


def _write_evidence_file(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, content)
