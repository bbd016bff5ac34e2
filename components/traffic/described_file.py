"""What a recorded file is, and a scene that flies it: ``dsa-des check FILE``."""

import json
from pathlib import Path

import numpy as np

from components.formats.recorded.traffic_of_files import instant_as_text
from components.formats.text_rows import TrafficFile, TrafficFileError
from components.traffic.files import FileTrafficParameters, read_selected_traffic
from dsa_des.errors import UsageError
from dsa_des.scene.data_files import DataScene
from dsa_des.text.safe_text import shell_line, shorten

_MOST_NAMES = 6


def scene_of_recording(path: Path) -> DataScene:
    """Return a scene that flies a recorded file before sensors, and the file's description."""
    file = str(path.absolute())
    try:
        content = read_selected_traffic(FileTrafficParameters(file=Path(file)))
    except TrafficFileError as error:
        raise UsageError(*str(error).split("\n")) from None
    traffic = {
        "type": "traffic.file",
        "file": file,
        "intruder": {"extends": "aircraft/general_aviation_fitted.toml"},
    }
    tables = {
        "extends": "detect_and_sense",
        "title": f"{path.name}, {content.kind}",
        "blocks": {"traffic": traffic},
    }
    return DataScene(tables, describe_file(path, content))


def describe_file(path: Path, content: TrafficFile) -> list[str]:
    """Return text lines on a file: format, aircraft, times, area, heights, usable commands."""
    aircraft = content.aircraft
    first = min(float(craft.sample_times_s[0]) for craft in aircraft)
    last = max(float(craft.sample_times_s[-1]) for craft in aircraft)
    count = sum(len(craft.sample_times_s) for craft in aircraft)
    names = ", ".join(shorten(craft.name, 24) for craft in aircraft[:_MOST_NAMES])
    more = f", and {len(aircraft) - _MOST_NAMES} more" if len(aircraft) > _MOST_NAMES else ""
    edges = [
        f"{min(map(np.min, values)):.5g} to {max(map(np.max, values)):.5g}"
        for values in zip(*((c.lat_deg, c.lon_deg, c.alt_m) for c in aircraft), strict=True)
    ]
    away = sum(0 if craft.away is None else int(np.count_nonzero(craft.away)) for craft in aircraft)
    begins, ends = (instant_as_text(content.start_time_s + time_s) for time_s in (first, last))
    word = shell_line([str(path)])
    lines = [
        f"{path.name}: {content.kind}; {content.units}",
        f"  aircraft  {len(aircraft)} in {count:,} samples: {names}{more}",
        f"  time      {begins} to {ends}, {last - first:g} s",
        f"  place     latitudes {edges[0]}, longitudes {edges[1]} deg",
        f"  height    {content.height}, {edges[2]} m",
    ]
    if away:
        lines.append(f"  gaps      {away} in which an aircraft is not there")
    lines += [
        f"  ownship   {shorten(content.ownship.name, 24)}, the first; "
        "--set blocks.traffic.ownship=NAME takes another",
        "To fly it before the sensors of detect_and_sense:",
        f"  dsa-des run {word}" + (" --duration 600" if last - first > 1200.0 else ""),
    ]
    if len(aircraft) > 1:
        lines += [
            "For the alerts of DO-365B:",
            f"  dsa-des alert {word} --conf alerting/do365b.conf --out alerts.csv",
        ]
    lines += [
        "In a scene:",
        "  [blocks.traffic]",
        '  type = "traffic.file"',
        f"  file = {json.dumps(str(path))}",
    ]
    return lines
