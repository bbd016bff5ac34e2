"""Parameters of every tracker that estimates states."""

from typing import Any, Literal

from pydantic import Field, model_validator

from components.tracking.life import LONGEST_WINDOW, LifeRules
from dsa_des.block.component import NonNegativeRational, Parameters


class TrackerParameters(Parameters):
    """Parameters of every tracker that estimates states."""

    acceleration_intensity_m2_s3: float = Field(
        default=4.0, gt=0,
        description="Intensity of the white acceleration that targets are taken to have, m²/s³.",
    )  # fmt: skip
    association: Literal["nearest", "gnn", "jpda"] = Field(
        default="gnn",
        description="Which detection is whose: the nearest in turn, the least sum over all "
        "(global nearest neighbour), or all of them weighed (joint probabilistic).",
    )
    gate_probability: float = Field(
        default=0.997, gt=0, lt=1,
        description="Probability that a target's detection lies in its gate.",
    )  # fmt: skip
    start_gate_probability: float = Field(
        default=0.999999, ge=0, lt=1,
        description="Probability of a wider gate about confirmed tracks: what is detected in it "
        "starts no track of its own; 0 for none.",
    )  # fmt: skip
    detection_probability: float = Field(
        default=0.9, gt=0, lt=1, description="Probability that a look at a target detects it."
    )
    false_alarms_per_scan: float = Field(
        default=0.1, gt=0,
        description="False alarms that a sensor is taken to have in a scan of its whole field.",
    )  # fmt: skip
    jpda_exact_detections: int = Field(
        default=10, ge=1, le=16,
        description="Detections in a cluster up to which `jpda` is exact; belief propagation "
        "beyond.",
    )  # fmt: skip
    initiation: Literal["m_of_n", "likelihood_ratio"] = Field(
        default="m_of_n", description="The rule that confirms a track."
    )
    confirm_m: int = Field(default=3, ge=1, description="Hits that confirm a track (`m_of_n`).")
    confirm_n: int = Field(
        default=5, ge=1, le=LONGEST_WINDOW, description="Expected looks in which they must fall."
    )
    false_confirmation: float = Field(
        default=1e-4, gt=0, lt=0.5,
        description="Share of false tracks that `likelihood_ratio` confirms.",
    )  # fmt: skip
    missed_confirmation: float = Field(
        default=0.01, gt=0, lt=0.5, description="Share of true tracks that it drops."
    )
    start_existence: float = Field(
        default=0.2, gt=0, lt=1,
        description="Probability that a detection that belongs to no track is of a target.",
    )  # fmt: skip
    start_speed_m_s: float = Field(
        default=70.0, gt=0,
        description="Standard deviation of a new track's velocity along each axis, m/s.",
    )  # fmt: skip
    assumed_range_m: float | None = Field(
        default=None, gt=0,
        description="Range that is assumed of what is seen without one, m; its inverse is taken to "
        "be known to 50 %. By default a quarter of the farthest reach of the sensors.",
    )  # fmt: skip
    use_range_rate: bool = Field(
        default=True,
        description="Whether range rates are used where a sensor states them with a variance; not "
        "those that fold, or that are exact.",
    )
    delete_misses: int = Field(
        default=10, ge=1, description="Expected looks in vain in a row that end a confirmed track."
    )
    delete_after_s: float = Field(
        default=6.0, gt=0, description="Time without a detection after which any track ends, s."
    )
    delete_above_m: float = Field(
        default=3000.0, gt=0,
        description="Standard deviation of a position that ends a track with a range, m.",
    )  # fmt: skip

    late: Literal["drop", "one_step", "rerun"] = Field(
        default="one_step",
        description="What becomes of a look that comes after a later one: tracks that the later "
        "one updated do without it (`drop`), tracks are corrected by one step back and forth "
        "(`one_step`), or all looks since it are worked on again in order (`rerun`).",
    )
    lag_s: NonNegativeRational | None = Field(
        default=None,
        description="How much older than the newest a look may be to be worked on after all, s; "
        "older ones are left out and counted. By default as late as the scene says that one may "
        "come, and 1 s at least.",
    )

    @model_validator(mode="after")
    def _possible(self) -> Any:
        if self.confirm_m > self.confirm_n:
            raise ValueError(
                f"confirm_m = {self.confirm_m} hits cannot fall in confirm_n = {self.confirm_n} "
                "looks; allowed: at most as many"
            )
        return self

    def without_effect(self) -> list[str]:
        """Say which keys belong to an association, a rule or a lateness that is not chosen."""
        said = super().without_effect()
        if self.association != "jpda":
            because = f"association is '{self.association}'"
            said += self.idle("jpda_exact_detections", because=because)
        unused = {
            "m_of_n": ("false_confirmation", "missed_confirmation"),
            "likelihood_ratio": ("confirm_m", "confirm_n"),
        }
        said += self.idle(*unused[self.initiation], because=f"initiation is '{self.initiation}'")
        if self.start_gate_probability <= self.gate_probability:
            because = f"gate_probability is {self.gate_probability:g}"
            said += self.idle("start_gate_probability", because=because)
        return said

    def life(self) -> LifeRules:
        """Return the rules of a track's life."""
        return LifeRules(
            self.initiation, self.confirm_m, self.confirm_n, self.false_confirmation,
            self.missed_confirmation, self.delete_misses,
        )  # fmt: skip
