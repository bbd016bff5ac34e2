"""Reading ``[[outages]]``: blocks that fail at random and are repaired.

::

    [[outages]]
    blocks = ["radar", "eo"]       # fail together, as a power bus does
    mean_between_s = 600
    mean_repair_s = 20
    restart_s = 3
"""

from collections.abc import Mapping
from typing import Any

from pydantic import Field, model_validator

from dsa_des.block.component import Parameters
from dsa_des.errors import did_you_mean
from dsa_des.scene.checks import read_table
from dsa_des.scene.scene_file import SceneFile

OUTAGES = "outages"
#: Outages of a run, on average: more are a slip of the pen.
_MOST = 100_000


class Outage(Parameters):
    """An item of ``outages``: times between failures and to repair are exponential."""

    name: str | None = Field(
        default=None, description="What fails, as its draws are keyed; by default its blocks."
    )
    blocks: tuple[str, ...] = Field(min_length=1, description="Blocks that are out together.")
    mean_between_s: float = Field(
        gt=0, description="Mean time from the start, or from being back, to the next failure, s."
    )
    mean_repair_s: float = Field(gt=0, description="Mean time from a failure to its repair, s.")
    restart_s: float = Field(
        default=0.0, ge=0, description="Time from the repair to the first output, s."
    )

    @property
    def key(self) -> str:
        """What its draws are keyed by."""
        return self.name or ", ".join(self.blocks)

    def sentence(self) -> str:
        """Return, for example, ``radar, eo: out after 600 s up, for 23 s, on average``."""
        out_s = self.mean_repair_s + self.restart_s
        blocks = ", ".join(self.blocks)
        return f"{blocks}: out after {self.mean_between_s:g} s up, for {out_s:g} s, on average"

    @model_validator(mode="after")
    def _each_once(self) -> "Outage":
        if len(set(self.blocks)) < len(self.blocks):
            raise ValueError(f"blocks is {list(self.blocks)}: each stands there once")
        return self


def read_outages(scene_file: SceneFile, blocks: Mapping[str, Any], duration_s: Any) -> list[Outage]:
    """Return the outages of a scene; what is wrong with them is reported."""
    entries = scene_file.data.get(OUTAGES, [])
    if not isinstance(entries, list):
        scene_file.report((OUTAGES,), "must be a list of tables: [[outages]]", entries)
        return []
    read: list[Outage] = []
    for number, entry in enumerate(entries):
        outage = read_table(scene_file, (OUTAGES, number), Outage, entry)
        if outage is None:
            continue
        for name in outage.blocks:
            cls = blocks.get(name)
            if name not in blocks:
                message = f"the scene has no such block{did_you_mean(name, blocks)}"
                scene_file.report((OUTAGES, number, "blocks"), message, str(name))
            elif cls is not None and cls.process is not None:
                message = f"{name} has a process of its own, which an outage cannot stop"
                scene_file.report((OUTAGES, number, "blocks"), message)
        if outage.key in [one.key for one in read]:
            message = "fails already: give each a name of its own, which keys its draws"
            scene_file.report((OUTAGES, number), message, outage.key)
        if duration_s is not None and duration_s > _MOST * outage.mean_between_s:
            message = f"must be longer: at most {_MOST:,} failures of a run are drawn"
            scene_file.report((OUTAGES, number, "mean_between_s"), message, outage.mean_between_s)
        read.append(outage)
    return read
