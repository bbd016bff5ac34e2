"""A recorded flight in pixels, against a pinhole by matrices in Earth-centred axes of its own."""

import math

import numpy as np
import pytest
from wired import chain, rows, run

from components.geometry import body_angles, line_of_sight_ned, ned_to_body
from components.optical.picture import Pinhole

A, F = 6378137.0, 1 / 298.257223563
MOUNT_DEG = (7.0, -3.0, -12.0)
TOP, SIDE = 20.0, 40.0


def earth(lat_deg, lon_deg, alt_m):
    """Return Earth-centred positions, (n, 3)."""
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    e2 = F * (2 - F)
    n = A / np.sqrt(1 - e2 * np.sin(lat) ** 2)
    return np.stack([(n + alt_m) * np.cos(lat) * np.cos(lon),
                     (n + alt_m) * np.cos(lat) * np.sin(lon),
                     (n * (1 - e2) + alt_m) * np.sin(lat)], axis=-1)  # fmt: skip


def about(axis, angle):
    """Return the matrix that turns components into axes turned by an angle about one of them."""
    c, s = math.cos(angle), math.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    m = np.eye(3)
    m[i, i] = m[j, j] = c
    m[i, j], m[j, i] = s, -s
    return m


def projected(own, attitude_deg, intruder, mount_deg, focal_px, principal_px):
    """Return columns and rows by K [R | t], frame by frame."""
    found = []
    away = earth(*intruder) - earth(*own)
    for k in range(len(away)):
        lat, lon = np.radians(own[0][k]), np.radians(own[1][k])
        # Earth-centred to north, east, down: about the polar axis, then about east.
        level = about(1, -lat - math.pi / 2) @ about(2, lon)
        turned = level
        for angles in (np.radians([a[k] for a in attitude_deg]), np.radians(mount_deg)):
            yaw, pitch, roll = angles
            turned = about(0, roll) @ about(1, pitch) @ about(2, yaw) @ turned
        ahead, right, down = turned @ away[k]
        found.append((principal_px[0] + focal_px[0] * right / ahead,
                      principal_px[1] + focal_px[1] * down / ahead))  # fmt: skip
    return np.array(found).T


def flight(times_s):
    """Return a banked ownship at heading 217 deg in the south, and an intruder ahead of it."""
    t = np.asarray(times_s)
    own = [-42.0 - 3.2e-4 * t, 179.995 - 3.1e-4 * t, 900.0 + 2.0 * t]
    attitude = [217.0 + 0.8 * t, 3.0 + 0.1 * t, -20.0 + 0.5 * t]
    return own, attitude, [-42.0099 + 1e-4 * t, 179.9841 + 2e-4 * t, 990.0 - 3.0 * t]


def test_poses_of_frames_come_out_as_pixels_of_a_calibrated_camera():
    """As docs/pictures.md has it: time stamps of its own, a principal point off the middle."""
    frame_s = np.cumsum(np.random.default_rng(2).uniform(0.05, 0.2, 60))
    own, attitude, _ = flight(frame_s)
    logged_s = np.arange(-0.3, frame_s[-1] + 1.0, 0.7)
    intruder = [np.interp(frame_s, logged_s, values) for values in flight(logged_s)[2]]
    focal, principal = (1180.0, 1175.0), (1010.0, 540.0)
    body = ned_to_body(*line_of_sight_ned(*own, *intruder), *np.radians(attitude))
    camera = Pinhole.from_intrinsics(focal, principal, columns=2048, rows=1024)
    directions = body_angles(*ned_to_body(*body, *np.radians(MOUNT_DEG)))
    column, row = camera.pixel(*directions)
    true = projected(own, attitude, intruder, MOUNT_DEG, focal, principal)
    assert np.ptp(true, axis=1).min() > 50.0
    np.testing.assert_allclose([column, row], true, atol=1e-5)
    np.testing.assert_allclose(camera.direction(column, row), directions, atol=1e-12)


def test_a_focal_length_of_nothing_is_refused():
    with pytest.raises(ValueError, match="focal_px is 0 and 1: both must be above 0"):
        Pinhole.from_intrinsics((0.0, 1.0), (5.0, 5.0), 10, 10)


def test_recorded_tracks_are_a_path_in_pixels_of_a_scene(tmp_path):
    """Both aircraft with time stamps of their own; detections say the true pixel of each frame."""
    lines = ["time_s,id,lat_deg,lon_deg,alt_m,yaw_deg,pitch_deg,roll_deg"]
    for name, times in (("own", np.arange(0.0, 8.01, 0.1)), ("other", np.arange(0.0, 8.5, 0.37))):
        own, attitude, intruder = flight(times)
        place, turned = (own, attitude) if name == "own" else (intruder, 0.0 * np.array(attitude))
        lines += [
            f"{t:.2f},{name}," + ",".join(f"{values[k]:.12g}" for values in (*place, *turned))
            for k, t in enumerate(times)
        ]
    path = tmp_path / "flown.csv"
    path.write_text("\n".join(lines) + "\n")
    camera = {
        "type": "optical.image", "scan_rate_hz": 10, "azimuth_deg": [-SIDE, SIDE],
        "elevation_deg": [-TOP, TOP], "azimuth_pixels": 2048, "elevation_pixels": 1024,
        "mount_azimuth_deg": MOUNT_DEG[0], "mount_elevation_deg": MOUNT_DEG[1],
        "mount_roll_deg": MOUNT_DEG[2], "noise_equivalent_contrast": 0.005, "threshold": 0.2,
    }  # fmt: skip
    scene = chain({"eye": camera}, duration_s=7)
    scene["blocks"]["traffic"] = {
        "type": "traffic.csv", "file": str(path), "ownship": "own",
        "intruder": {"eo": {"front_m2": 4.0, "side_m2": 20.0, "horizontal_m2": 50.0}},
    }  # fmt: skip
    seen = [row for row in rows(run(scene)) if row["target"] == "other"]
    assert len(seen) > 50
    own, attitude, intruder = flight([row["time_s"] for row in seen])
    focal = 1024.0 / math.tan(math.radians(SIDE)), 512.0 / math.tan(math.radians(TOP))
    true = projected(own, attitude, intruder, MOUNT_DEG, focal, (1024.0, 512.0))
    found = [[row["true_column_px"] for row in seen], [row["true_row_px"] for row in seen]]
    np.testing.assert_allclose(found, true, atol=0.02)
    assert np.ptp(true, axis=1).max() > 50.0
