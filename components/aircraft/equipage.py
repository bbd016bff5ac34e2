"""What aircraft carry for others to know them by: transponders and position broadcasts."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, model_validator

from components.arguments.units import NAUTICAL_MILE_M
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.component import Parameters
from dsa_des.time.randomness import target_keys

#: 95 % radius of the horizontal position error by navigation accuracy category, NACp 1 to 11, m
#: (RTCA DO-260B, table 2-71); of the velocity error by NACv 1 to 4, m/s (table 2-22).
POSITION_RADIUS_M = np.array(
    [
        np.nan,
        *(NAUTICAL_MILE_M * nmi for nmi in (10.0, 4.0, 2.0, 1.0, 0.5, 0.3, 0.1, 0.05)),
        30.0,
        10.0,
        3.0,
    ]
)
VELOCITY_RADIUS_M_S = np.array([np.nan, 10.0, 3.0, 1.0, 0.3])
#: Standard deviations of each of two axes in the 95 % radius of both, 2.448.
RADIUS_IN_DEVIATIONS = math.sqrt(-2.0 * math.log(0.05))
#: 95 % of errors of geometric height by their accuracy, GVA 1 and 2, m (the same, table 2-71).
HEIGHT_ERROR_M = np.array([np.nan, 150.0, 45.0])
_95_IN_DEVIATIONS = 1.959964


def _check_icao_address(given: str) -> str:
    # All 0 and all 1 are nobody's (ICAO Annex 10 III, 9, appendix).
    if not re.fullmatch("[0-9A-Fa-f]{6}", given) or int(given, 16) in (0, 0xFFFFFF):
        raise ValueError("must be six hexadecimal digits, neither all 0 nor all F")
    return given


#: A 24-bit address as text.
IcaoAddress = Annotated[str, AfterValidator(_check_icao_address)]


class AdsBEquipage(Parameters):
    """What an aircraft broadcasts of itself, and how good it is."""

    nacp: int = Field(
        default=8,
        ge=1,
        le=11,
        description="Navigation accuracy category of position: 95 % within 10, 4, 2, 1, 0.5, 0.3, "
        "0.1, 0.05 nmi, 30, 10, 3 m for 1 to 11.",
    )
    nacv: int = Field(
        default=1,
        ge=1,
        le=4,
        description="That of velocity: 95 % within 10, 3, 1, 0.3 m/s for 1 to 4.",
    )
    nic: int | None = Field(
        default=None,
        ge=1,
        le=11,
        description="Navigation integrity category that it sends; by default the number of nacp.",
    )
    gva: int | None = Field(
        default=None,
        ge=1,
        le=2,
        description="Geometric vertical accuracy: 95 % of the heights above the ellipsoid that it "
        "sends beside pressure altitudes within 150, 45 m for 1, 2; it sends none if left out.",
    )
    latency_s: float = Field(
        default=0.0,
        ge=0,
        le=2,
        description="Age of the position that is sent, s; 14 CFR 91.227 allows 2.",
    )
    compensated_s: float = Field(
        default=0.0,
        ge=0,
        le=2,
        description="How much of latency_s the aircraft carries its position on by its velocity.",
    )
    silent_after_s: float | None = Field(
        default=None,
        ge=0,
        description="From when on nothing is sent, s of the run; never if not given.",
    )
    spoofed_north_m: float = Field(
        default=0.0, ge=-50_000, le=50_000, description="How far north of itself it says it is, m."
    )
    spoofed_east_m: float = Field(
        default=0.0, ge=-50_000, le=50_000, description="How far east of itself it says it is, m."
    )
    spoofed_up_m: float = Field(
        default=0.0, ge=-5000, le=5000, description="How far above itself it says it is, m."
    )

    @model_validator(mode="after")
    def _check_compensation(self) -> Self:
        if self.compensated_s > self.latency_s:
            raise ValueError(
                f"compensated_s is {self.compensated_s:g}: it must be at most latency_s, "
                f"{self.latency_s:g}"
            )
        return self


class EquipageShares(Parameters):
    """Shares (0 to 1) of aircraft that keep their type's Mode S, Mode C, ADS-B; drawn by name."""

    mode_s: float = Field(
        default=1.0,
        ge=0,
        le=1,
        description="Share that keeps mode_s.",
        json_schema_extra={"unit": ""},
    )
    mode_c: float = Field(
        default=1.0,
        ge=0,
        le=1,
        description="Share that keeps mode_c.",
        json_schema_extra={"unit": ""},
    )
    ads_b: float = Field(default=1.0, ge=0, le=1, description="Share that keeps ads_b.")


@dataclass(frozen=True, eq=False)
class Equipage:
    """The equipage of all aircraft of a roster, (aircraft,) each; NaN without broadcasts."""

    mode_s: BoolArray
    mode_c: BoolArray
    ads_b: BoolArray
    nacp: IntArray
    nacv: IntArray
    nic: IntArray
    latency_s: FloatArray
    compensated_s: FloatArray
    silent_after_s: FloatArray
    #: North, east and up, (3, aircraft).
    spoofed_m: FloatArray
    gva: IntArray
    address: IntArray

    @property
    def position_deviation_m(self) -> FloatArray:
        """Standard deviation of each horizontal axis of position, m."""
        return np.asarray(POSITION_RADIUS_M[self.nacp] / RADIUS_IN_DEVIATIONS)

    @property
    def velocity_deviation_m_s(self) -> FloatArray:
        """Standard deviation of each horizontal axis of velocity, m/s."""
        return np.asarray(VELOCITY_RADIUS_M_S[self.nacv] / RADIUS_IN_DEVIATIONS)

    @property
    def height_deviation_m(self) -> FloatArray:
        """Standard deviation of broadcast geometric heights, m; NaN where none are broadcast."""
        return np.asarray(HEIGHT_ERROR_M[self.gva] / _95_IN_DEVIATIONS)

    @property
    def uncompensated_latency_s(self) -> FloatArray:
        """Seconds by which broadcast positions are late: their latency less its compensation."""
        return self.latency_s - self.compensated_s

    @classmethod
    def from_aircraft(cls, aircraft: Sequence[Any], keys: NDArray[np.uint64]) -> Self:
        """Return the equipage of aircraft; `keys` give addresses to those without their own."""
        # A large fleet is of few kinds.
        kinds = {id(one): one for one in aircraft}
        number = {key: index for index, key in enumerate(kinds)}
        index = np.array([number[id(one)] for one in aircraft], dtype=np.int64)

        def column(read: Callable[[Any], Any], kind: type) -> AnyArray:
            return np.array([read(one) for one in kinds.values()], dtype=kind)[index]

        def ads_b_column(name: str, otherwise: float, kind: type) -> AnyArray:
            def value(one: Any) -> Any:
                given = getattr(one.ads_b, name, None)
                return otherwise if given is None else given

            return column(value, kind)

        nacp, nic = ads_b_column("nacp", 0, int), ads_b_column("nic", 0, int)
        own = column(lambda one: int(one.icao_address or "0", 16), int)
        drawn = (keys & np.uint64(0xFFFFFF)).astype(np.int64)
        return cls(
            column(lambda one: one.mode_s, bool),
            column(lambda one: one.mode_c, bool),
            column(lambda one: one.ads_b is not None, bool),
            nacp,
            ads_b_column("nacv", 0, int),
            np.where(nic == 0, nacp, nic),
            ads_b_column("latency_s", 0.0, float),
            ads_b_column("compensated_s", 0.0, float),
            ads_b_column("silent_after_s", np.inf, float),
            np.stack(
                [ads_b_column(f"spoofed_{axis}_m", 0.0, float) for axis in ("north", "east", "up")]
            ),
            ads_b_column("gva", 0, int),
            np.where(own == 0, drawn, own),
        )


def draw_equipage(
    names: Sequence[str], aircraft: Sequence[Any], shares: EquipageShares, stream: Any
) -> list[Any]:
    """Return copies of aircraft that keep Mode S, Mode C, ADS-B by share, drawn by their names."""
    keys, of_kind = target_keys(tuple(names)), dict[Any, Any]()
    kept = [
        stream.uniform(keys, np.int64(0), draw) < share
        for draw, share in enumerate((shares.mode_s, shares.mode_c, shares.ads_b))
    ]
    result = []
    for one, *keeps in zip(aircraft, *(part.tolist() for part in kept), strict=True):
        kind = (id(one), *keeps)
        if kind not in of_kind:
            mode_s, mode_c, ads_b = keeps
            of_kind[kind] = one.model_copy(update={
                "mode_s": one.mode_s and mode_s,
                "mode_c": one.mode_c and mode_c,
                "ads_b": one.ads_b if ads_b else None,
            })  # fmt: skip
        result.append(of_kind[kind])
    return result
