"""What sensors need to know of aircraft, and of all aircraft of a run."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from components.aircraft.equipage import AdsBEquipage, Equipage, IcaoAddress
from components.aircraft.table_files import RcsTableFile, SilhouetteTableFile
from dsa_des.arrays.types import AnyArray, BoolArray, FloatArray, IntArray
from dsa_des.block.component import Parameters
from dsa_des.time.randomness import target_keys


class VisibleAreas(Parameters):
    """Areas of the three bodies that stand for an aircraft in an EO camera's picture: sphere,
    cylinder and horizontal plane (thesis §3.5.2).
    """

    front_m2: float = Field(ge=0, description="Area of the sphere, m² (Table 3.1).")
    side_m2: float = Field(ge=0, description="Area of the cylinder seen abeam, m².")
    horizontal_m2: float = Field(ge=0, description="Area of the horizontal plane, m².")
    made_for: Literal["convex_hull"] | None = Field(
        default=None,
        description="Silhouette of a camera that shows what these areas were fitted to; `check` "
        "warns where a camera has another. By default they are the thesis's, which are added.",
    )
    silhouette_table: SilhouetteTableFile | None = Field(
        default=None,
        description="CSV with az_deg, el_deg and area_m2 of the observer's direction from the "
        "aircraft, for cameras with silhouette 'aspect_table'.",
    )


class InfraredAreas(VisibleAreas):
    """The same areas for an IR camera, and one from behind (§3.5.3, Tables 3.2 and 4.6)."""

    back_m2: float = Field(ge=0, description="Area of the sphere seen from behind, m².")


class LaserSurface(Parameters):
    """What a laser hits: a surface of some area, or a piece of wire."""

    reflectivity: float = Field(
        default=0.2,
        gt=0,
        le=1,
        description="Diffuse reflectivity at the laser's wavelength; 0.2 is an assumption.",
    )
    area_m2: float | None = Field(
        default=None,
        gt=0,
        description="Area that it shows from any side, m²; by default the silhouette of its EO "
        "areas.",
    )
    wire_diameter_mm: float | None = Field(
        default=None, gt=0, le=1000, description="Thickness of a wire in place of an area, mm."
    )
    wire_length_m: float | None = Field(
        default=None, gt=0, description="Length of the wire that stands for this target, m."
    )
    wire_direction_deg: float = Field(
        default=0.0, ge=-360, le=360, description="Where the wire runs to, deg from north."
    )
    wire_slope_deg: float = Field(
        default=0.0, ge=-90, le=90, description="How much it rises that way, deg."
    )

    @model_validator(mode="after")
    def _check_wire_or_surface(self) -> Self:
        if (self.wire_diameter_mm is None) != (self.wire_length_m is None):
            raise ValueError("wire_diameter_mm and wire_length_m belong together: give both")
        if self.wire_diameter_mm is not None and self.area_m2 is not None:
            raise ValueError("area_m2 and wire_diameter_mm are given: it is a surface or a wire")
        return self


# The thesis's general aviation class, so that a scene may leave the aircraft out.
_EO = VisibleAreas(front_m2=12.0, side_m2=30.0, horizontal_m2=90.0)
_IR = InfraredAreas(front_m2=4.6, back_m2=4.6, side_m2=11.15, horizontal_m2=35.52)


class Aircraft(Parameters):
    """What sensors need to know of one aircraft; files in ``configs/aircraft`` hold these keys."""

    may_change: ClassVar[tuple[str, ...]] = ("mode_s", "mode_c", "ads_b")

    rcs_dbsm: float = Field(default=3.01, description="Mean radar cross-section, dBsm (Table 4.1).")
    rcs_table: RcsTableFile | None = Field(
        default=None,
        description="CSV with az_deg, el_deg and dbsm of the radar's direction from the aircraft; "
        "used in place of rcs_dbsm.",
    )
    swerling: Literal[0, 1, 2, 3, 4, 5] = Field(
        default=1, description="Fluctuation model of the radar cross-section; 0 and 5 are steady."
    )
    eo: VisibleAreas = Field(default=_EO, description="Areas seen by EO cameras.")
    ir: InfraredAreas = Field(default=_IR, description="Areas seen by IR cameras.")
    contrast: float = Field(default=1.0, ge=0, description="Contrast gain P for EO (eq. 18).")
    contrast_ir: float = Field(default=1.0, ge=0, description="Contrast gain P for IR (eq. 18).")
    paint_reflectance: float = Field(
        default=0.5, ge=0, le=1, description="Diffuse reflectance, for EO with a background."
    )
    laser: LaserSurface = Field(
        default=LaserSurface(), description="What lasers hit of it; by default its EO silhouette."
    )
    engine: Literal["propeller", "turbofan", "turbojet"] = Field(
        default="propeller", description="Propulsion type (Table 4.5)."
    )
    mode_s: bool = Field(
        default=False, strict=True, description="Whether it has a Mode S transponder."
    )
    mode_c: bool = Field(
        default=False,
        strict=True,
        description="Whether a Mode C one, which gives no identity; Mode S counts first.",
    )
    ads_b: AdsBEquipage | None = Field(
        default=None,
        description="What it broadcasts; nothing if left out, or false.",
    )
    icao_address: IcaoAddress | None = Field(
        default=None,
        description="24-bit address of Mode S and ADS-B, six hexadecimal digits; by default one "
        "that follows from its name.",
    )

    @field_validator("ads_b", mode="before")
    @classmethod
    def _replace_false_by_none(cls, given: Any) -> Any:
        return None if given is False else given


#: The name of whose place a scene is seen from where nothing else is said.
OWNSHIP = "ownship"

# A target without areas is a point, of a centimetre.
_LEAST_EXTENT_M = 0.01


def _has_equal_fields(one: Aircraft, other: Aircraft) -> bool:
    """Return whether two aircraft agree in every field, so that no sensor can tell them apart."""
    return one is other or all(
        getattr(one, name) == getattr(other, name) for name in Aircraft.model_fields
    )


@dataclass(frozen=True, eq=False)
class Roster:
    """A run's targets: names, random-draw keys, and the aircraft properties that sensors need.

    Replicas in lock step may have other aircraft of the same names: columns, and indices of tables,
    are then over the aircraft of the first replica, those of the second, and so on. Of whoever
    looks there is one, or one for each replica.
    """

    names: tuple[str, ...]
    aircraft: tuple[Aircraft, ...]
    own_name: str = OWNSHIP
    own_aircraft: tuple[Aircraft, ...] = (Aircraft(),)
    #: The same from instants of the run on (ns, rising), where the equipage changes.
    later: tuple[tuple[int, "Roster"], ...] = ()

    @classmethod
    def from_pairs(
        cls,
        targets: Sequence[tuple[str, Aircraft]],
        own: tuple[str, Aircraft] = (OWNSHIP, Aircraft()),
    ) -> "Roster":
        """Return the roster of (name, aircraft) pairs; two with one address are refused."""
        bearers: dict[str, str] = {}
        for name, craft in (own, *targets):
            if craft.icao_address and (craft.mode_s or craft.ads_b):
                other = bearers.setdefault(craft.icao_address.upper(), name)
                if other != name:
                    raise ValueError(
                        f"icao_address {craft.icao_address!r} is that of {other!r} and of "
                        f"{name!r}: each aircraft has one of its own; give another, or leave it "
                        "out"
                    )
        names, aircraft = zip(*targets, strict=True) if targets else ((), ())
        return cls(names, aircraft, own[0], (own[1],))

    def seen_from(self, target: int) -> "Roster":
        """Return the roster that a sensor on this target sees: it and the ownship swap places."""
        known: dict[int, Roster] = self.__dict__.setdefault("_seen_from", {})
        if target not in known:
            width, own = len(self.names), self.own_aircraft
            names, aircraft = list(self.names), list(self.aircraft)
            looking = aircraft[target::width]
            aircraft[target::width] = own if len(own) > 1 else own * len(looking)
            names[target] = self.own_name
            later = tuple((from_ns, then.seen_from(target)) for from_ns, then in self.later)
            known[target] = Roster(
                tuple(names), tuple(aircraft), self.names[target], tuple(looking), later
            )
        return known[target]

    def __len__(self) -> int:
        return len(self.names)

    def __eq__(self, other: object) -> bool:
        return self is other or (
            isinstance(other, Roster)
            and self.names == other.names
            and self.own_name == other.own_name
            and self.later == other.later
            and all(map(_has_equal_fields, self.aircraft, other.aircraft))
            and all(map(_has_equal_fields, self.own_aircraft, other.own_aircraft))
        )

    def __hash__(self) -> int:
        return hash(self.names)

    @cached_property
    def keys(self) -> AnyArray:
        """64-bit keys (targets,) that seed each target's random draws, made from its name."""
        return target_keys(self.names)

    def draw_keys_of(self, targets: IntArray) -> AnyArray:
        """Return the 64-bit random-draw keys (n,) of these targets, without computing others."""
        if "keys" in self.__dict__:
            return self.keys[targets]
        keys, known = self._draw_keys_computed
        there = known[targets]
        if np.count_nonzero(there) < there.size:
            new = np.unique(targets[~there])
            keys[new] = target_keys(tuple(self.names[i] for i in new.tolist()))
            known[new] = True
        return keys[targets]

    @cached_property
    def _draw_keys_computed(self) -> tuple[AnyArray, AnyArray]:
        return np.zeros(len(self.names), dtype=np.uint64), np.zeros(len(self.names), dtype=bool)

    @cached_property
    def rcs_m2(self) -> FloatArray:
        """Mean radar cross-section in m², shape (targets,)."""
        return np.array([10.0 ** (craft.rcs_dbsm / 10.0) for craft in self.aircraft])

    @cached_property
    def extents_m(self) -> FloatArray:
        """Length, span, height (targets, 3), m, by target, from its areas in an EO camera."""
        front, side, plane = (
            self.column(f"eo.{body}_m2") for body in ("front", "side", "horizontal")
        )
        # No fuselage is more than twelve times as long as it is thick.
        height = np.maximum(np.sqrt(4.0 * front / np.pi), np.sqrt(side / 12.0))
        height = np.maximum(height, _LEAST_EXTENT_M)
        span = np.maximum(np.sqrt(3.0 * plane), height)
        return np.column_stack([side / height + height, span, height])

    @cached_property
    def equipage(self) -> Equipage:
        """Surveillance equipment of every aircraft, with further rows for each later change."""
        every = [*self.aircraft, *(one for _, then in self.later for one in then.aircraft)]
        return Equipage.from_aircraft(every, np.tile(self.keys, len(every) // max(1, len(self))))

    def equipage_rows(self, craft: IntArray, instant_ns: IntArray) -> IntArray:
        """Return rows of `equipage` for these aircraft (indices) at these instants, elementwise."""
        if not self.later:
            return craft
        begins_ns = [from_ns for from_ns, _ in self.later]
        return craft + len(self.aircraft) * np.searchsorted(begins_ns, instant_ns, side="right")

    @cached_property
    def ever_broadcasts(self) -> BoolArray:
        """Return whether each aircraft sends ADS-B at any time of the run, shape (targets,)."""
        return np.asarray(self.equipage.ads_b.reshape(1 + len(self.later), -1).any(axis=0))

    @cached_property
    def propulsion_types(self) -> AnyArray:
        """Propulsion type of each target, shape (targets,) of text."""
        return np.array([craft.engine for craft in self.aircraft], dtype=np.str_)

    @cached_property
    def swerling(self) -> AnyArray:
        """Swerling model of each target, 5 written as 0, shape (targets,)."""
        return np.array([craft.swerling % 5 for craft in self.aircraft], dtype=np.int64)

    @cached_property
    def swerling_models(self) -> tuple[int, ...]:
        """Return the numbers of the Swerling models that occur, ascending; 5 is written as 0."""
        return tuple(sorted({craft.swerling % 5 for craft in self.aircraft}))

    @property
    def is_same_in_all_replicas(self) -> bool:
        """Return whether all replicas have the same aircraft."""
        return len(self.aircraft) == len(self.names)

    def aircraft_index(self, target: IntArray, replica: IntArray) -> IntArray:
        """Return the index into `aircraft` of each target in each replica, elementwise."""
        return target if self.is_same_in_all_replicas else replica * len(self.names) + target

    def column(self, path: str) -> FloatArray:
        """Return every aircraft's number (aircraft,) at an attribute path like ``ir.front_m2``."""
        columns: dict[str, FloatArray] = self.__dict__.setdefault("_columns", {})
        if path not in columns:
            read = attrgetter(path)
            columns[path] = np.array([read(craft) for craft in self.aircraft], dtype=np.float64)
        return columns[path]

    def tables(self, path: str) -> tuple[tuple[Any, ...], IntArray]:
        """Return each different table found at an attribute path such as ``eo.silhouette_table``,
        and for every aircraft the index of its table, -1 for none.
        """
        cache: dict[str, Any] = self.__dict__.setdefault("_tables", {})
        if path not in cache:
            tables: list[Any] = []
            index = np.full(len(self.aircraft), -1, dtype=np.int64)
            for target, craft in enumerate(self.aircraft):
                file = attrgetter(path)(craft)
                if file is None:
                    continue
                same = [i for i, table in enumerate(tables) if table is file.table]
                index[target] = same[0] if same else len(tables)
                if not same:
                    tables.append(file.table)
            cache[path] = tuple(tables), index
        result: tuple[tuple[Any, ...], IntArray] = cache[path]
        return result


#: What other aircraft of replicas may have of their own; see `merge_replica_rosters`.
_MAY_DIFFER = ("rcs_dbsm", "mode_s", "mode_c", "ads_b", "icao_address")


def merge_replica_rosters(
    first: Roster,
    aircraft: Sequence[tuple[str, Aircraft]],
    own: Sequence[tuple[str, Aircraft]] = (),
) -> Roster | None:
    """Return one roster for all replicas' aircraft, or None if more than RCS and equipage differ.

    Radar cross-sections and equipage may differ: how far a sensor looks, and which physics it has,
    does not rest on them. Whatever else differs may decide how far a sensor looks. The `own` ones
    are those of the replicas that look; left out, they are all alike.
    """
    width = len(first)
    if width == 0:
        return None if aircraft else first
    if len(aircraft) % width:
        return None
    alike = [
        _is_equal_if_mergeable(one, (first.names[number % width], first.aircraft[number % width]))
        for number, one in enumerate(aircraft)
    ]
    alike += [_is_equal_if_mergeable(one, (first.own_name, first.own_aircraft[0])) for one in own]
    if None in alike:
        return None
    if all(alike):
        return first
    mine = tuple(craft for _, craft in own) or first.own_aircraft
    return Roster(first.names, tuple(craft for _, craft in aircraft), first.own_name, mine)


def _is_equal_if_mergeable(one: tuple[str, Aircraft], other: tuple[str, Aircraft]) -> bool | None:
    """Return True if equal, False if only `_MAY_DIFFER` fields differ, None if not mergeable."""
    if one[0] != other[0]:
        return None
    if _has_equal_fields(one[1], other[1]):
        return True
    differing = (
        field
        for field in Aircraft.model_fields
        if getattr(one[1], field) != getattr(other[1], field)
    )
    return False if all(field in _MAY_DIFFER for field in differing) else None
