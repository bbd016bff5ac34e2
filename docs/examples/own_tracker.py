"""A tracker of one's own, put into a scene as a class: it smooths what the fusion measured."""

import numpy as np
from pydantic import Field

import dsa_des
from components.messages import FusedDetections, Tracks
from components.messages.false_detections import without_false_alarms
from dsa_des.block.wake import Wake


class SmoothingParameters(dsa_des.Parameters):
    """Parameters of the tracker, for scene files: units in names, bounds, a description."""

    gain: float = Field(0.5, gt=0, le=1, description="Weight of a new measurement, 1.")


class SmoothingTracker(dsa_des.Component):
    """Moves each target's direction by a share of the way to its last measurement."""

    inputs = {"fused": dsa_des.Input(FusedDetections, "trigger", "Fused lines of sight.")}
    outputs = {"tracks": dsa_des.Output(Tracks, "Targets that were just updated.")}
    Parameters = SmoothingParameters

    def setup(self) -> None:
        """Start with no tracks."""
        self._held: dict[int, tuple[float, float]] = {}

    def run(self, wake: Wake) -> Tracks | None:
        """Take in one message of the fusion; angles are body angles in radians."""
        fused = wake["fused"]
        if fused is None:
            return None
        fused = without_false_alarms(fused)  # a false alarm belongs to no target
        if len(fused.target) == 0:
            return None
        azimuth, elevation = fused.azimuth_rad.copy(), fused.elevation_rad.copy()
        for entry, target in enumerate(fused.target.tolist()):
            if target in self._held:
                held_azimuth, held_elevation = self._held[target]
                turn = np.remainder(azimuth[entry] - held_azimuth + np.pi, 2 * np.pi) - np.pi
                azimuth[entry] = held_azimuth + self.p.gain * turn
                step = elevation[entry] - held_elevation
                elevation[entry] = held_elevation + self.p.gain * step
            self._held[target] = float(azimuth[entry]), float(elevation[entry])
        return Tracks(
            tick=wake.ticks,
            offsets=fused.offsets,
            target=fused.target,
            azimuth_rad=azimuth,
            elevation_rad=elevation,
            range_m=fused.range_m,
            age_s=np.zeros(len(fused.target)),
            contributors=fused.contributors,
            roster=fused.roster,
            sensors=fused.sensors,
        )


def main() -> None:
    scene = dsa_des.load_scene("first_light").set({"duration_s": 60})
    own = scene.swap(tracker=SmoothingTracker).set({"blocks.tracker.gain": 0.2})
    for one in (scene, own):
        tracks = dsa_des.run(one).tracks.to_pylist()
        steps = np.abs(np.diff([t["azimuth_rad"] for t in tracks if t["target"] == "head_on"]))
        name = one.blocks["tracker"].type_name
        print(f"{name}: {len(tracks)} rows, mean step {steps.mean():.2e} rad")


if __name__ == "__main__":
    main()
