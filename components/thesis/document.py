"""The page docs/thesis.md: the whole table, the errata that matter, and the figures of a run."""

from components.thesis.made import Made
from components.thesis.registry import Item
from components.thesis.row import Row

_HEAD = """# The thesis, figure by figure

Every result of *Simulation of a Detect and Sense System* that can be made, beside what it prints.
Written by `dsa-des reproduce --page docs/thesis.md`; `--json` prints the same rows. The scenes are
in [configs/thesis](../configs/thesis), the systems of Table 2.4 in
[configs/systems](../configs/systems); edit them and run the command again.

*Agrees* means within half a unit of the last printed digit, unless the last column says what else
is allowed for. There is one set of parameters per sensor, and no row has its own:

| sensor | file | where its free parameters come from |
| --- | --- | --- |
| OASys radar | `configs/sensors/oasys.toml` | Table 2.2; the bandwidth from one printed value, Pd 0.9114 for 1.76 dBsm at 6.91 km |
| AFRL EO cameras | `configs/sensors/afrl_eo.toml` | Table 2.5; a = 0.3 and threshold 1 as printed; P = 1 and b = 0 (not printed) give Table 4.4 |
| MIDAS IR | `configs/sensors/midas_ir.toml` | Table 2.6; a, threshold, P and b as for EO (assumption) |
"""

_ERRATA = """## Where the thesis is in error, and what we use

| place | printed | used here |
| --- | --- | --- |
| eq. 7, 8 | neither integration gain nor noise figure | both, from Table 2.2; losses 0 dB |
| Table 2.2 | no bandwidth | calibrated; flight test and specification contradict each other (486 and 4283 Hz) |
| §4.1.1 | 3.5 sm = 6.48 km | 3.5 statute miles are 5.63 km, 3.5 nautical miles 6.48 km |
| eq. 12 | sqrt(b² · a²) | sqrt(b² + a²) |
| eq. 9-13 | small angles; the plane projected twice | the exact projection; the thesis's form is kept as a model of its own |
| eq. 20, 21 | a and b ambiguous | relative heading 0 flies away and shows its back |
| eq. 23 | "Rayleigh" | it is the exponential distribution of power |
| eq. 27 | Gram-Charlier term without 1/sqrt(2π) | exact Pd; the series, corrected, only to compare |
| eq. 32 | undefined for one pulse | Pd = Pfa^(1/(1+SNR)) |
| §4.1.3 | three probabilities | no one bandwidth gives all three |
| Table 3.1 | front of the Beech 99 and the F-16 lost | 12 m² (recovered from Table 4.4) and 7 m² (assumption) |
| Table 4.3 | 82 % | 8.2 % |
| Table 4.4 | P and b not given | P = 1, b = 0 |
| Table 4.6 | back "doubled", but as in Table 3.2 | Table 3.2 holds the doubled values |
| §4.2.1 | 20 % in area are 600 m in range everywhere | 9.5 % of the range, 600 m near 6 km |
| §4.5 | half of the IR detections are fused | exact: 2 and 5 Hz meet once a second |
"""


def short(value: float, sign: bool = False) -> str:
    """Return a number with four significant digits."""
    text = f"{value:+.4g}" if sign else f"{value:.4g}"
    if "e" in text and 1e-4 < abs(value) < 1e9:
        return f"{value:+.0f}" if sign else f"{value:.0f}"
    return text


def markdown(results: list[tuple[Item, Made]], images: str) -> str:
    """Return the page.

    Parameters
    ----------
    results : list of (Item, Made)
    images : str
        Folder of the figures, as seen from the page.
    """
    rows = [row for _, made in results for row in made.rows]
    statuses = [row.status.partition(",")[0] for row in rows]
    counts = ", ".join(f"{statuses.count(name)} *{name}*" for name in dict.fromkeys(statuses))
    parts = [_HEAD, f"{len(rows)} rows: {counts}.\n", _ERRATA]
    for item, made in results:
        parts.append(_section(item, made, images))
    return "\n".join(parts)


def _section(item: Item, made: Made, images: str) -> str:
    lines = [f"## {item.title} ({_label(item)})", ""]
    lines += ["| quantity | printed | ours | difference | unit | status | why |"]
    lines += ["| --- | ---: | ---: | ---: | --- | --- | --- |"]
    lines += [_line(row) for row in made.rows]
    lines.append("")
    if made.note:
        lines += [made.note, ""]
    for picture in made.pictures:
        lines += [f"![{picture.caption}]({images}/{picture.name}.png)", "", picture.caption, ""]
    return "\n".join(lines)


def _line(row: Row) -> str:
    difference = "" if row.difference is None else short(row.difference, sign=True)
    cells = (row.quantity, row.printed or "", short(row.ours), difference, row.unit, row.status,
             row.why)  # fmt: skip
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _label(item: Item) -> str:
    kind, _, number = item.name.partition("-")
    return {"fig": "Fig. ", "table": "Table ", "sec": "§", "eq": "eq. "}[kind] + number
