"""TECVOL's and AFRL's systems with the filters that Table 2.4 names."""

import dsa_des


def tracked(name, duration_s):
    scene = dsa_des.load_scene(f"configs/systems/{name}.toml", duration_s=duration_s)
    return scene, dsa_des.run(scene)["state_tracks"].to_pylist()


def test_tecvol_tracks_on_the_radar_and_cameras_only_sharpen():
    """From 3 km on, 92 s into the encounter, the cameras' angles are within the radar's cell."""
    scene, found = tracked("tecvol_tracked", "100")
    assert scene.blocks["tracker"].type_name == "tracking.ekf"
    confirmed = [row for row in found if row["track_status"] == "confirmed"]
    assert all(row["has_range"] and "radar" in row["contributors"] for row in confirmed)
    early = [row for row in confirmed if 60 < row["time_s"] < 88]
    late = [row for row in confirmed if row["updated_by"] == "radar+eo+ir"]
    assert early and late
    spread = [min(row["azimuth_variance_rad2"] for row in rows) for rows in (early, late)]
    assert spread[1] < 0.3 * spread[0]


def test_afrl_weighs_the_cooperative_and_the_other_sensors():
    """TCAS tells the range, the cameras the direction: the track is better than either."""
    scene, found = tracked("afrl_tracked", "75")
    assert scene.blocks["tracker"].type_name == "tracking.ekf"
    by = {row["updated_by"] for row in found}
    assert {"tcas", "centre"} <= by
    confirmed = [row for row in found if row["track_status"] == "confirmed"]
    seen = [row for row in confirmed if "centre" in row["contributors"] and row["has_range"]]
    assert seen
    assert min(row["azimuth_variance_rad2"] for row in seen) ** 0.5 < 0.001
