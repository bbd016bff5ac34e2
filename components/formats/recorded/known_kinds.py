"""Files of recorded aircraft, whatever their kind: which one it is shows in the content."""

import io
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path

from components.formats.asterix_file import recording_of_asterix
from components.formats.asterix_records import decode_records_with_notes
from components.formats.csv_file import recording_of_rows, recording_of_table
from components.formats.daa_file import recording_of_daa
from components.formats.receiver_logs import parse_receiver_log
from components.formats.recorded import ulog_file
from components.formats.recorded.autopilot_logs import is_tlog, tlog_log, ulog_log
from components.formats.recorded.captures import is_capture, udp_times_and_payloads
from components.formats.recorded.igc_file import igc_log, is_igc
from components.formats.recorded.json_records import is_json, recording_of_json
from components.formats.recorded.xml_tracks import xml_log
from components.formats.recording import Recording
from components.formats.reports import Log, build_recording
from components.formats.sample_columns import Altitude
from components.formats.text_rows import (
    ALL_TOKENS,
    NO_UNIT,
    Problems,
    TrafficFileError,
    clean_token,
    iterate_lines,
    read_content,
    text_of,
    tokens,
)
from dsa_des.files.input_files import LARGEST_BYTES

#: What is read, for messages.
KINDS = (
    "aircraft.json and traces of readsb, SBS-1 lines, OpenSky's states (JSON, CSV, Parquet, text), "
    "FlightRadar24's JSON, tables with time, name, latitude, longitude and altitude, .daa and .xyz "
    "of DAIDALUS, GPX, KML with times, IGC, PX4's .ulg, MAVLink's .tlog, and ASTERIX, also in pcap "
    "and pcapng"
)
#: So many of the needed columns may be missing of what is taken for a table of ours.
_LACKING = 3
_PARQUET, _ZIP = b"PAR1", b"PK\x03\x04"
#: How files of other kinds begin, and what to do with them.
_OTHERS = (
    (b"\xa3\x95", "is a DataFlash log of ArduPilot: pymavlink's mavlogdump.py makes a table of its "
     "GPS messages (.csv), and a ground station a .tlog"),
    (b"MATLAB", "is a MATLAB file: dsa-des encounters convert reads tracks in it"),
    (b"\x89HDF", "is an HDF5 file: save its table as CSV or Parquet"),
    (b"SQLite format 3", "is an SQLite database: save its table as CSV"),
    (b"\x89PNG", "is a picture"),
    (b"%PDF", "is a PDF"),
    (b"# labels_initial", "is an encounter model: dsa-des encounters generate --model samples it"),
)  # fmt: skip


def recording_of_file(
    path: Path,
    altitude: Altitude | None = None,
    place: tuple[float, float, float] | None = None,
) -> Recording:
    """Return a `Recording` of the aircraft in a file of any known format.

    Parameters
    ----------
    path : Path
    altitude : optional
        Which altitude is read where there are two.
    place : (latitude, longitude, altitude), optional
        Where radars are that do not say it, and the origin of an ``.xyz`` file: deg, m.

    Raises
    ------
    TrafficFileError
        All that is wrong with it, or that it is of no known kind.
    UsageError
        It is ASTERIX, and the extra ``asterix`` is not installed.
    """
    problems = Problems(str(path))
    data = _unzip(problems, read_content(path, problems))
    stem = re.sub(r"(\.\w{1,7}){1,2}$", "", path.name) or path.name
    if data.startswith(_PARQUET):
        return _read_parquet(problems, data, altitude, stem)
    if is_capture(data):
        return _read_capture(problems, data, altitude, place)
    if path.suffix.lower() == ".ast" or _is_asterix(data):
        return recording_of_asterix(problems, data, altitude, place=place)
    log = _log_of(problems, data, stem)
    if log is not None:
        del data  # its reader holds what it needs of it
        return build_recording(problems, log, None, altitude)
    if is_json(data):
        return recording_of_json(problems, data, None, altitude, stem)
    for begins, said in _OTHERS:
        if data.startswith(begins):
            problems.fail(f"{said}; what is read: {KINDS}")
    text = text_of(data, problems, f"a file of a known kind ({KINDS})")
    lines, is_daa = iterate_lines(text), _is_daa(text)
    del data, text  # the lines hold it while there are more
    if path.suffix.lower() in (".daa", ".xyz") or is_daa:
        return recording_of_daa(problems, lines, place or (0.0, 0.0, 0.0))
    try:
        return recording_of_table(problems, lines, None, altitude, stem)
    except TrafficFileError as error:
        if sum("there is no column" in problem for problem in error.problems) < _LACKING:
            raise
    problems = Problems(str(path))
    problems.fail(
        "is of no known kind. As a table it must have a row of names with columns for time, "
        f"latitude, longitude and altitude, and one of names; what is read: {KINDS}"
    )


def _log_of(problems: Problems, data: bytes, stem: str) -> Log | None:
    if data.startswith(ulog_file.MAGIC):
        return ulog_log(problems, data, stem)
    if is_tlog(data):
        return tlog_log(problems, data, stem)
    if is_igc(data[:8192]):
        return igc_log(problems, data, stem)
    if data[:64].lstrip(b"\xef\xbb\xbf\r\n\t ").startswith(b"<"):
        tracks = xml_log(problems, data, stem)
        if tracks is None:
            problems.fail(f"is XML, but neither GPX nor KML; what is read: {KINDS}")
        return tracks
    return parse_receiver_log(problems, data)


def _unzip(problems: Problems, data: bytes) -> bytes:
    """Return the one file of an archive (``.kmz``, ``.csv.zip``), or the content as it is."""
    if not data.startswith(_ZIP):
        return data
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            inside = [
                one for one in archive.infolist()
                if not one.is_dir() and not one.filename.startswith("__MACOSX/")
            ]  # fmt: skip
            first = [one for one in inside if one.filename.lower().endswith(".kml")] or inside
            if len(first) != 1 and first is inside:
                problems.fail(f"is an archive of {len(inside)} files: give them one by one")
            if first[0].file_size > LARGEST_BYTES:
                problems.fail(f"holds more than {LARGEST_BYTES / 2**20:,.0f} MB")
            return archive.read(first[0])
    except TrafficFileError:
        raise
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, OSError, EOFError) as error:
        problems.fail(f"the archive is damaged ({error})")
    except Exception as error:  # of the packing inside
        problems.fail(f"the archive is damaged ({type(error).__name__}: {error})")


def _is_asterix(data: bytes) -> bool:
    """Return whether data consists of ASTERIX data blocks from its first byte to its last."""
    at = 0
    while at < len(data):
        size = int.from_bytes(data[at + 1 : at + 3], "big")
        if size < 3 or at + size > len(data):
            return False
        at += size
    return at > 0


def asterix_blocks_of_capture(path: Path) -> bytes | None:
    """Return the ASTERIX data blocks in a packet capture; None if the file is no capture."""
    if path.suffix.lower() not in _CAPTURES:
        return None
    problems = Problems(str(path))
    _, blocks, _ = _asterix_time_bytes_and_others(problems, read_content(path, problems))
    return blocks


_CAPTURES = (".pcap", ".pcapng", ".cap")


def _asterix_time_bytes_and_others(problems: Problems, data: bytes) -> tuple[float, bytes, int]:
    """Return the first ASTERIX datagram's time, their joined content, and the number of others.

    Where not all can be read, each is tried by itself: other protocols may look like data blocks,
    and a radar may speak an edition that is not known.
    """
    sent = udp_times_and_payloads(problems, data)
    blocks = [(time_s, payload) for time_s, payload in sent if _is_asterix(payload)]
    path = Path(problems.path)
    if blocks and not _holds_asterix_records(path, b"".join(payload for _, payload in blocks)):
        blocks = [one for one in blocks if _holds_asterix_records(path, one[1])]
    if not blocks:
        problems.fail(f"none of {len(sent)} datagrams of the capture is ASTERIX that can be read")
    return blocks[0][0], b"".join(payload for _, payload in blocks), len(sent) - len(blocks)


def _holds_asterix_records(path: Path, data: bytes) -> bool:
    try:
        decode_records_with_notes(path, data)
    except TrafficFileError:
        return False
    return True


def _read_capture(
    problems: Problems, data: bytes, altitude: Altitude | None,
    place: tuple[float, float, float] | None,
) -> Recording:  # fmt: skip
    """Return a `Recording` of a capture's ASTERIX datagrams, dated by the capture's day."""
    first_s, blocks, other = _asterix_time_bytes_and_others(problems, data)
    recording = recording_of_asterix(problems, blocks, altitude, of_day_s=first_s, place=place)
    if other:
        recording.notes.warnings.append(
            f"{other} datagrams are no ASTERIX that can be read and were left out"
        )
    return recording


def _is_daa(text: str) -> bool:
    """Return whether a table has a row of units or local offsets, as DAIDALUS's do."""
    lines = (one for one in iterate_lines(text) if not one[1].startswith("#"))
    names = [token.lower() for token in tokens(next(lines, (0, ""))[1])]
    units = tokens(next(lines, (0, ""))[1])
    if {"sx", "sy", "sz"} <= {*names}:
        return True
    known = ALL_TOKENS | NO_UNIT.keys()
    said = [clean_token(unit) for unit in units]
    return len(said) > 3 and all(one in known for one in said) and not any(
        one.isdigit() for one in said
    )  # fmt: skip


_BATCH = 16_384


def _read_parquet(
    problems: Problems, data: bytes, altitude: Altitude | None, stem: str
) -> Recording:
    """Return the aircraft of a Parquet table, which has the columns of a CSV table."""
    import pyarrow as pa
    import pyarrow.compute as pc
    import pyarrow.parquet as pq

    problems.of = "row"
    try:
        file = pq.ParquetFile(pa.BufferReader(data))
        headers = list(file.schema_arrow.names)
    except (pa.ArrowException, OSError, ValueError) as error:
        problems.fail(f"is no Parquet file that can be read ({error})")

    def cells(column: pa.Array) -> list[str]:
        if pa.types.is_dictionary(column.type):
            column = column.dictionary_decode()
        if pa.types.is_timestamp(column.type):
            # Of naive times those of UTC are meant.
            column = column.cast(pa.timestamp("us")).cast(pa.int64())
            column = pc.divide(column.cast(pa.float64()), 1e6)
        try:
            text = column.cast(pa.string())
        except pa.ArrowException:  # lists and the like: no column of ours
            return [""] * len(column)
        found: list[str] = pc.fill_null(text, "").to_pylist()
        return found

    def rows() -> Iterator[tuple[int, list[str]]]:
        number = 1
        try:
            for batch in file.iter_batches(_BATCH):
                for row in zip(*map(cells, batch.columns), strict=True):
                    yield number, list(row)
                    number += 1
        except (pa.ArrowException, OSError, ValueError) as error:
            problems.fail(f"the Parquet file is damaged ({error})")

    return recording_of_rows(
        problems, headers, 1, rows(), None, altitude, stem, kind="a Parquet table"
    )
