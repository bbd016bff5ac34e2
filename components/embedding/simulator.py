"""Detect and sense inside a host simulator that owns time (thesis Appendix A, as an API)."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from components.aircraft.aircraft import Aircraft
from components.embedding.host_scene import (
    load_for_host,
    planes_in_scene,
    refuse_keys_needing_flights,
    traffic_block_name,
    with_host_traffic,
)
from components.embedding.planes import FixedPath, make_plane, plane_index
from components.embedding.result import EncounterResult, Sighting, sightings_and_false_alarms
from components.embedding.states import checked_pose_rows, traffic_states
from components.messages.detections import Detections
from components.messages.fused import FusedDetections
from dsa_des.embed import HostDriven, Step
from dsa_des.errors import Problem, SceneError
from dsa_des.scene.scene import Scene


class Simulator:
    """The sensors and the fusion of a scene, called by a host that moves the aircraft.

    The scene's traffic is replaced by the host's positions; a scene need not have any. Its scan
    clocks stay: a call makes, for each sensor, the latest scan that has fallen due since the call
    before (at most one, so a call takes bounded time), with the positions of this call and the
    scan's own number. A host on a fixed step thus gets every scan of a sensor that is slower than
    its step, at most one step late; of a faster sensor one scan per step, and `Result.missed`
    counts the others. Called at the scan instants themselves (`next_scan_s`) it gives, bit for
    bit, the detections of the scene run whole.

    Parameters
    ----------
    scene : path or Scene
    sets, swaps : iterable of str
        As ``--set`` and ``--swap``; for a path only.
    seed : int, optional
        Overrides the scene's.
    beyond_fusion : bool
        Whether to run also what the answer does not rest on, such as a tracker behind the fusion;
        its messages are then in `Result.messages`.
    platform : str, optional
        Of a scene in which several aircraft or places carry a chain, the one that the host's
        ownship is; the blocks of others are left out.

    Raises
    ------
    SceneError
        With every problem of the scene; also if it needs more than an open-loop chain (feedback,
        delays, shared processors), or flights between the host's calls, or has no fusion.
    """

    def __init__(
        self,
        scene: Scene | Path | str,
        *,
        sets: Iterable[str] = (),
        swaps: Iterable[str] = (),
        seed: int | None = None,
        beyond_fusion: bool = False,
        platform: str | None = None,
    ) -> None:
        self.scene = load_for_host(scene, sets=sets, swaps=swaps, seed=seed, platform=platform)
        self._source = traffic_block_name(self.scene)
        refuse_keys_needing_flights(self.scene)
        self._planes = planes_in_scene(self.scene)
        self._fixed: dict[int, FixedPath] = {}
        #: One chain for all planes, or one for each when the host calls plane by plane.
        self._chains: list[HostDriven] = []
        self._plane_by_plane = False
        self._fusion = self._find_only_fusion()
        self._wanted = None if beyond_fusion else [self._fusion]
        # Whatever the planes will be, this scene can be driven or it cannot.
        self._clocks = self._new_chain()

    # -- before the first call -----------------------------------------------------------------

    @property
    def planes(self) -> tuple[str, ...]:
        """Names of the planes, in the order in which they were added."""
        return tuple(plane.name for plane in self._planes)

    def add_plane(
        self,
        name: str | None = None,
        *,
        aircraft: Path | str | Aircraft | Mapping[str, Any] | None = None,
        rcs_dbsm: float | None = None,
        swerling: int | None = None,
        eo: Mapping[str, float] | None = None,
        ir: Mapping[str, float] | None = None,
        contrast: float | None = None,
        contrast_ir: float | None = None,
        position: ArrayLike | None = None,
        orientation: ArrayLike = (0.0, 0.0, 0.0),
        times_s: ArrayLike | None = None,
        **more: Any,
    ) -> str:
        """Add a plane before `simulate` is first called; return its name (thesis ``addplane``).

        Parameters
        ----------
        name : str, optional
            Keys the plane's random draws; by default ``plane_1``, ``plane_2``, ...
        aircraft : path, Aircraft or mapping, optional
            A file such as ``configs/aircraft/f_16.toml``, or its keys; the others override it.
        rcs_dbsm : float, dB above 1 m²
        swerling : {0, 1, 2, 3, 4, 5}
        eo, ir : mapping
            Areas in m²: ``front_m2``, ``side_m2``, ``horizontal_m2``, for IR also ``back_m2``.
        contrast, contrast_ir : float
        position : (3,) or (times, 3) array_like, optional
            Latitude (rad), longitude (rad), altitude (m) of a plane that the host does not move.
            The arrays given to `simulate` then hold the other planes only.
        orientation : (3,) or (times, 3) array_like, rad
            Yaw, pitch and roll that go with `position`.
        times_s : (times,) array_like, optional
            When each row of `position` begins to hold.
        **more
            Any other key of an aircraft file.

        Returns
        -------
        str
            The name.

        Raises
        ------
        SceneError
            If a key is unknown or a value out of range.
        ValueError
            If the name is taken, shapes do not fit, or `simulate` was called already.
        """
        if self._chains:
            raise ValueError(
                "planes are added before the first call; one that comes later is added at the "
                "start too, and its position is NaN until it is there"
            )
        name = f"plane_{len(self._planes) + 1}" if name is None else name
        if name in self.planes:
            raise ValueError(f"name is {name!r}: there is a plane of this name already")
        values = {
            "rcs_dbsm": rcs_dbsm, "swerling": swerling, "eo": eo, "ir": ir, "contrast": contrast,
            "contrast_ir": contrast_ir, **more,
        }  # fmt: skip
        plane = make_plane(name, aircraft, values)
        if position is not None:
            self._fixed[len(self._planes)] = FixedPath(position, orientation, times_s)
        elif times_s is not None:
            raise ValueError("times_s is given without position: it says when its rows hold")
        self._planes.append(plane)
        return name

    def start(self, *, plane_by_plane: bool = False) -> None:
        """Build sensors and fusion now and run them once, so that the first call is not slow.

        The first call does so otherwise.

        Parameters
        ----------
        plane_by_plane : bool
            Whether the host will call once for each plane (``simulate(..., plane=name)``).
        """
        if self._chains:
            return
        self._plane_by_plane = plane_by_plane
        # A rehearsal on a chain of its own loads modules and fills tables; nothing remembers it.
        self._rehearse(self._new_chain())
        self._unseen = [Sighting(name) for name in self.planes]
        self._free = [i for i in range(len(self._planes)) if i not in self._fixed]
        count = len(self._planes) if plane_by_plane else 1
        self._chains = [self._new_chain() for _ in range(count)]

    # -- time ----------------------------------------------------------------------------------

    def next_scan_s(self, after_s: object = None) -> float:
        """Return when any sensor scans next after a time, s, so that a host can step by scans.

        Parameters
        ----------
        after_s : float, optional
            By default the time of the last call; before the first, the scene's start, included.
        """
        if not self._chains:
            return self._clocks.next_scan_s(after_s)
        if after_s is not None:
            return self._clocks.next_scan_after_tick_s(self._chains[0].tick_of(after_s))
        return self._clocks.next_scan_after_tick_s(max(chain.last_tick for chain in self._chains))

    def simulate(
        self,
        lla_ownship: ArrayLike,
        att_ownship: ArrayLike,
        lla_intruder: ArrayLike,
        att_intruder: ArrayLike,
        time_s: object,
        *,
        plane: str | int | None = None,
    ) -> EncounterResult:
        """Run all scans due at an instant, given positions and attitudes, and return which planes
        are detected where and by which sensors.

        Parameters
        ----------
        lla_ownship : (3,) array_like
            Geodetic latitude and longitude (WGS-84) in rad, altitude above the ellipsoid in m.
        att_ownship : (3,) array_like, rad
            Yaw, pitch and roll, NED to body axes.
        lla_intruder, att_intruder : (planes, 3) array_like
            The same for every plane that the host moves, in the order in which they were added; a
            row of NaN for one that is not there. (3,) for a single one, and with `plane`.
        time_s : float
            Seconds since the scene's start, rounded to the nearest tick; it never goes back. A time
            that adding up steps in floats may have led off a scan means that scan.
        plane : str or int, optional
            The host calls plane by plane; at the same instant this gives the same as one call for
            all. False alarms belong to no plane and are then left out. A host keeps to one way.

        Returns
        -------
        EncounterResult

        Raises
        ------
        ValueError
            If a shape, a number or the time cannot be used; nothing has happened then.
        """
        wanted = plane is not None
        if not self._chains:
            self.start(plane_by_plane=wanted)
        if wanted != self._plane_by_plane:
            raise ValueError("a host calls for all planes at once or plane by plane, not both")
        own = checked_pose_rows("ownship", lla_ownship, att_ownship, 1, missing=False)
        if plane is None:
            chain, chosen = self._chains[0], None
            free = self._free
        else:
            number = plane_index(plane, self.planes)
            chain, chosen = self._chains[number], [number]
            free = [] if number in self._fixed else [number]
        moved = checked_pose_rows("intruder", lla_intruder, att_intruder, len(free))
        tick = chain.tick_of(time_s)
        step = chain.start_step(tick)
        planes_asked = range(len(self._planes)) if chosen is None else chosen
        if step.scans:
            rows = moved
            if len(free) != len(planes_asked):
                rows = self._poses_of_asked_planes(
                    moved, free, planes_asked, tick / chain.ticks_per_s
                )
            traffic: Any = chain.components[self._source]
            chain.run(step, traffic_states(own, rows, tick, traffic.roster, chosen))
        return self._make_result(step, planes_asked, chain.ticks_per_s)

    # -- inside --------------------------------------------------------------------------------

    def _new_chain(self) -> HostDriven:
        return HostDriven(with_host_traffic(self.scene, self._planes), self._source, self._wanted)

    def _find_only_fusion(self) -> str:
        fusions = [
            name
            for name, block in self.scene.blocks.items()
            if any(issubclass(out.message, FusedDetections) for out in block.cls.outputs.values())
        ]
        if len(fusions) != 1:
            message = (
                f"{len(fusions)} blocks fuse detections: a host is told what exactly one says, for "
                'example of type "fusion.pick_best"'
            )
            raise SceneError([Problem(str(self.scene.path), "blocks", message)])
        return fusions[0]

    def _rehearse(self, chain: HostDriven) -> None:
        """Run every sensor once on each plane, close by, to load modules and fill tables ahead."""
        own, count = np.zeros((1, 6)), len(self._planes)
        rows = np.zeros((count, 6))
        rows[:, 0] = 1e-4  # some 600 m ahead
        terrain: Any = self.scene.sections.get("terrain")
        if terrain is not None and terrain.height_m is not None:
            own[0, 2] = rows[:, 2] = terrain.height_m + 1000.0  # nobody flies below the ground
        traffic: Any = chain.components[self._source]
        for _ in range(len(self.scene.blocks)):
            step = chain.start_step(chain.tick_of(chain.next_scan_s()))
            chain.run(step, traffic_states(own, rows, step.tick, traffic.roster, None))

    def _poses_of_asked_planes(
        self, moved: Any, free: list[int], planes_asked: Sequence[int], time_s: float
    ) -> Any:
        """Return lat, lon, alt, yaw, pitch, roll of the asked planes, (planes, 6): those the host
        has moved, and fixed ones at the time.
        """
        rows = np.empty((len(planes_asked), 6))
        for row, number in enumerate(planes_asked):
            fixed = self._fixed.get(number)
            rows[row] = moved[free.index(number)] if fixed is None else fixed.at(time_s)
        return rows

    def _make_result(
        self, step: Step, planes_asked: Sequence[int], ticks_per_s: int
    ) -> EncounterResult:
        messages: dict[str, Any] = {name: message for (name, _), message in step.sent.items()}
        reported = {n: m for n, m in messages.items() if isinstance(m, Detections)}
        seen, false = sightings_and_false_alarms(messages.get(self._fusion), reported)
        sightings = tuple(seen.get(number) or self._unseen[number] for number in planes_asked)
        return EncounterResult(
            step.tick / ticks_per_s,
            sightings,
            () if self._plane_by_plane else false,
            step.scans,
            step.missed,
            messages,
        )
