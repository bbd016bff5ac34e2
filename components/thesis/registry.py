"""The results of the thesis that can be made, and the function that makes each."""

import importlib
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from components.thesis.made import Made
from dsa_des.errors import UsageError, did_you_mean


@dataclass(frozen=True)
class Item:
    """One result of the thesis.

    Parameters
    ----------
    name : str
    title : str
        What the thesis's caption says.
    maker : str
        ``module:function`` in this package.
    """

    name: str
    title: str
    maker: str

    def make(self) -> Made:
        """Compute it."""
        module, _, function = self.maker.partition(":")
        maker: Callable[[], Made] = getattr(
            importlib.import_module(f"components.thesis.{module}"), function
        )
        return maker()


ITEMS = (
    Item("fig-3.11", "Front and back sphere over relative heading", "front_and_back:make"),
    Item(
        "fig-4.2", "Pd of Swerling I and V over SNR, with the truncated table", "pd_over_snr:make"
    ),
    Item("sec-4.1.1", "Range at which OASys detects 5 m²", "specified_range:make"),
    Item("fig-4.3", "SNR and Pd over range, small target (1.76 dBsm)", "radar_range:small"),
    Item("fig-4.4", "SNR and Pd over range, medium target (3.01 dBsm)", "radar_range:medium"),
    Item("fig-4.5", "SNR and Pd over range, large target (6.99 dBsm)", "radar_range:large"),
    Item("sec-4.1.3", "Pd at the average detection ranges of the flight tests", "flight_pd:make"),
    Item("table-4.1", "RCS classes of the flight tests' aircraft", "rcs_classes:make"),
    Item("table-4.2", "Detection ranges of the flight tests", "flight_tests:make"),
    Item("fig-4.8", "Signature of the Beech 99 over rotation", "silhouettes:beech_99"),
    Item("fig-4.9", "Signature of the F-16 over rotation", "silhouettes:f_16"),
    Item("fig-4.10", "Signature of the Boeing 787 over rotation", "silhouettes:boeing_787"),
    Item("table-4.3", "Mean and maximum errors of the aircraft models", "silhouettes:errors"),
    Item("eq-34", "From an error in area to one in detection range", "area_error:make"),
    Item("table-4.4", "Detection ranges of the EO system", "eo_ranges:make"),
    Item("fig-4.11", "IR detection range over heading, first parameters", "ir_ranges:first"),
    Item("fig-4.13", "IR detection range over heading, refined parameters", "ir_ranges:refined"),
    Item("fig-4.14", "Errors of the fused output of an overtaking intruder", "overtaking:make"),
    Item("fig-4.17", "Fields of view of the three sensors", "fields_of_view:make"),
    Item("fig-4.18", "Radar Pd decreasing with range", "detections_over_range:make"),
    Item("fig-4.19", "Angular resolution of the radar", "angular_resolution:make"),
    Item("fig-4.20", "One intruder through two fields of view", "two_fields_of_view:make"),
    Item("fig-4.21", "Influence of the scan rate, and the timed scene", "scan_rate:make"),
    Item("fig-4.22", "Unsynchronised scans of radar and IR", "unsynchronised:make"),
    Item("table-2.4", "The systems of the literature", "systems:make"),
)

#: Numbers of the thesis that an item covers beside its own.
_ALSO = {("eq", "33"): "eq-34", ("eq", "33.34"): "eq-34"}
_KINDS = {"figure": "fig", "tab": "table", "section": "sec", "§": "sec", "equation": "eq"}


def chosen(names: Iterable[str]) -> list[Item]:
    """Return the items of these names, in the thesis's order; all of them if none is named.

    ``fig-4.14``, ``Fig. 4.14``, ``figure_4_14`` and ``4.14`` (where only one item has the number)
    are the same item.

    Raises
    ------
    UsageError
        If a name is unknown; it lists every unknown one with the nearest that exists.
    """
    wanted: set[str] = set()
    problems = []
    for name in names:
        found = _find(name)
        if len(found) == 1:
            wanted.add(found[0])
        elif found:
            problems.append(f"ITEM {name!r}: there are several; say {' or '.join(found)}")
        else:
            hint = did_you_mean(name.lower(), [item.name for item in ITEMS])
            problems.append(f"ITEM {name!r}: there is no such item{hint}")
    if problems:
        raise UsageError(problems[0], *(f"  {problem}" for problem in problems[1:]))
    return [item for item in ITEMS if not wanted or item.name in wanted]


def _find(name: str) -> list[str]:
    """Return the names of the items that a name may mean."""
    kind, number = _parts(name)
    if (kind, number) in _ALSO:
        return [_ALSO[kind, number]]
    parts = {item.name: _parts(item.name) for item in ITEMS}
    return [full for full, (k, n) in parts.items() if n == number and kind in ("", k)]


def _parts(name: str) -> tuple[str, str]:
    """Return ``("fig", "4.14")`` of any spelling of it."""
    match = re.fullmatch(r"([a-z§]*)[\s._-]*(\d+(?:[._-]\d+)*)", name.strip().lower())
    if match is None:
        return "", name
    kind, number = match.groups()
    return _KINDS.get(kind, kind), re.sub("[_-]", ".", number)
