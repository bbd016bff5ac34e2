"""What a case is made of: its files, with digests and copies, and its parameters with sources."""

import hashlib
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsa_des.block.ladder import Verified
from dsa_des.block.shipped_files import example_folders
from dsa_des.evidence.case import (
    WIRES,
    EvidenceCase,
    format_case_value,
    stated_source_of_parameter,
    wires_with_options,
)
from dsa_des.results.folder import StudyFolder
from dsa_des.scene.scene_file import COMMAND_LINE, read_scene_file
from dsa_des.studies.draws import file_sha256
from dsa_des.studies.study import Study
from dsa_des.studies.study_digest import study_input_files

#: Where a parameter is written that no file states.
DEFAULT = "default"


@dataclass(frozen=True)
class CaseFiles:
    """The files of a case."""

    #: What relative names count from.
    root: Path
    #: File → its name below the root; a shipped one's place among those.
    names: Mapping[Path, str]
    #: Name of the case's own file.
    case: str

    def relative_name(self, text: str) -> str:
        """Return the name below the root of a file of the case, given its path; return other texts
        unchanged, except that absolute paths keep only their last part.
        """
        path = Path(os.path.abspath(text))
        if path in self.names:
            return self.names[path]
        return path.name if os.path.isabs(text) else text

    def file_names_and_sha256(self) -> list[dict[str, str]]:
        """Return name and SHA-256 of every file of the case, sorted by name."""
        rows = [{"file": name, "sha256": file_sha256(path)} for path, name in self.names.items()]
        return sorted(rows, key=lambda row: (row["file"], row["sha256"]))

    def contents_by_name(self) -> dict[str, bytes]:
        """Return name → content of every file of the case that lies below its root."""
        return {
            name: path.read_bytes()
            for path, name in self.names.items()
            if path.is_relative_to(self.root)
        }


def files_of_case(case: EvidenceCase) -> CaseFiles:
    """Return the files that a case and its studies read."""
    own = Path(os.path.abspath(case.file.path))
    paths = {own, *_existing_paths(case.file.sources.values())}
    for study in case.studies.values():
        paths |= {Path(os.path.abspath(study.path)), *_existing_paths(study.base.sources.values())}
        paths |= set(_existing_paths(read_scene_file(study.path).sources.values()))
        paths |= {Path(os.path.abspath(path)) for path in study_input_files(study)}
    shipped = [Path(os.path.abspath(folder)) for folder in example_folders()]
    home = next((folder for folder in shipped if own.is_relative_to(folder)), None)
    mine = [p for p in paths if not any(p.is_relative_to(folder) for folder in shipped)]
    root = home or Path(os.path.commonpath([path.parent for path in mine]))
    names = {path: _relative_name(path, [root, *shipped]) for path in sorted(paths)}
    return CaseFiles(root, names, names[own])


def _relative_name(path: Path, folders: Iterable[Path]) -> str:
    """Return a file's name below the first of some folders that holds it, or its last part."""
    inside = [folder for folder in folders if path.is_relative_to(folder)]
    return path.relative_to(inside[0]).as_posix() if inside else path.name


def _existing_paths(sources: Iterable[str]) -> list[Path]:
    return [Path(os.path.abspath(source)) for source in set(sources) if source != COMMAND_LINE]


def parameter_and_wire_records(case: EvidenceCase, files: CaseFiles) -> list[dict[str, Any]]:
    """Return a dict for every parameter of the system's blocks and for every wire with options:
    key, value, meaning, where it is written, and its stated source.
    """
    study = case.system_study
    scene = study.scene(0)
    changed = {key.removeprefix("blocks.") for key, _ in study.sets}
    rows = []
    for name, block in scene.blocks.items():
        fields = type(block.parameters).model_fields
        values = block.parameters.model_dump(mode="json", exclude_none=True)
        for key, value in values.items():
            where = DEFAULT
            if key in block.parameters.model_fields_set:
                where = files.relative_name(study.base.source_file_of(("blocks", name, key)))
            if any(f"{one}.".startswith(f"{name}.{key}.") for one in changed):
                where = "the study or the case"
            rows.append({
                "key": f"{name}.{key}",
                "value": (
                    files.relative_name(value) if isinstance(value,
                    str) else format_case_value(value)
                ),
                "meaning": (fields[key].description or "") if key in fields else "",
                "written_in": where,
                "source": stated_source_of_parameter(case.tables.sources, name,
                key) if where != DEFAULT else None,
            })  # fmt: skip
    for wire in wires_with_options(scene):
        way = f"{wire.pop('from')} -> {wire.pop('to')}"
        rows.append({
            "key": f"{WIRES}.{way}",
            "value": ", ".join(f"{key} = {format_case_value(value)}" for key,
            value in wire.items()),
            "meaning": "What the wire does to messages.",
            "written_in": files.relative_name(study.base.source_file_of((WIRES,))),
            "source": stated_source_of_parameter(case.tables.sources, WIRES, way),
        })  # fmt: skip
    return rows


def models_of_blocks(study: Study) -> list[dict[str, Any]]:
    """Return a dict per block of the first scene: name, type, description, verification."""
    return [
        {
            "block": name, "type": block.type_name,
            "about": " ".join((block.cls.__doc__ or "").strip().partition("\n\n")[0].split()),
            "verified": [one._asdict() for one in verifications_of_class(block.cls)],
        }
        for name, block in study.scene(0).blocks.items()
    ]  # fmt: skip


def verifications_of_class(cls: type) -> list[Verified]:
    """Return what a block's class and bases were verified against, most general class first."""
    return [one for base in reversed(cls.__mro__) for one in vars(base).get("verified", ())]


def digest_of_results(folder: StudyFolder) -> str:
    """Return the SHA-256 of a study's result rows without their commands and errors."""
    import pyarrow as pa

    table = folder.results()
    kept = table.drop_columns([n for n in ("command", "error") if n in table.column_names])
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, kept.schema) as writer:
        writer.write_table(kept)
    return hashlib.sha256(sink.getvalue()).hexdigest()
