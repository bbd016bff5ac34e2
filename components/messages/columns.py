"""The meaning, unit and frame of every column of a run folder's tables.

Beside the messages' ``recorded``, which has the types; a test sees that none is missing.
"""

from collections.abc import Mapping

#: Column of every element of the covariance's upper triangle, row by row.
COVARIANCE = {
    (i, j): f"covariance_{i}{j}_m2{('', '_s', '_s2')[(i > 2) + (j > 2)]}"
    for i in range(6)
    for j in range(i, 6)
}

_BODY = "ownship's body axes: azimuth clockwise from the nose, elevation upward"
_NED = "north-east-down at the ownship"
_WGS84 = "WGS 84"
_FRAME = "north-east-down at the frame's origin"
_STATE = ("north_m", "east_m", "down_m", "north_m_s", "east_m_s", "down_m_s")
_OWN_NED = "north-east-down at the aircraft itself"
_TURNED = "north-east-down to body: yaw, pitch, roll"

#: Unit, frame, meaning.
Column = tuple[str, str, str]

#: Columns with which every table begins.
LEADING: Mapping[str, Column] = {
    "block": ("", "", "block that sent the message"),
    "tick": ("ticks", "", "instant, in the scene's ticks (`ticks_per_s` of run.json)"),
    "time_s": ("s", "", "the same instant since the start of the run"),
}

_MEASURED: Mapping[str, Column] = {
    "azimuth_rad": ("rad", _BODY, "measured azimuth"),
    "elevation_rad": ("rad", _BODY, "measured elevation"),
    "range_m": ("m", "", "measured slant range; null where none is measured"),
}
_TRUE: Mapping[str, Column] = {
    "true_azimuth_rad": ("rad", _BODY, "true azimuth"),
    "true_elevation_rad": ("rad", _BODY, "true elevation"),
    "true_range_m": ("m", "", "true slant range"),
}

_ERRORS: Mapping[str, Column] = {
    "range_rate_m_s": ("m/s", "", "measured range rate, positive when opening; null without one"),
    "azimuth_variance_rad2": ("rad²", _BODY, "mean square error of the azimuth, as stated"),
    "elevation_variance_rad2": ("rad²", _BODY, "mean square error of the elevation, as stated"),
    "range_variance_m2": ("m²", "", "mean square error of the range; null where none is measured"),
    "range_rate_variance_m2_s2": (
        "m²/s²",
        "",
        "mean square error of the range rate; null where none is measured",
    ),
}

_POSE: Mapping[str, Column] = {
    "own_lat_deg": ("deg", _WGS84, "where the ownship believes to be then: latitude"),
    "own_lon_deg": ("deg", _WGS84, "its longitude"),
    "own_alt_m": ("m", _WGS84, "its height above the ellipsoid"),
    "own_heading_rad": ("rad", _TURNED, "how it believes to be turned: nose, from north"),
    "own_pitch_rad": ("rad", _TURNED, "its pitch, nose up"),
    "own_roll_rad": ("rad", _TURNED, "its roll, right wing down"),
}
_OWN_VELOCITY: Mapping[str, Column] = {
    "own_velocity_north_m_s": (
        "m/s", _OWN_NED, "ownship's velocity over ground, north; null without a range rate"
    ),
    "own_velocity_east_m_s": ("m/s", _OWN_NED, "the same, east"),
    "own_velocity_down_m_s": ("m/s", _OWN_NED, "the same, down"),
}  # fmt: skip
#: Of what was put together or is held, the pose stands where navigation errs.
_ERRING_POSE = {
    name: (unit, frame, f"{meaning}; there is such a column where navigation errs")
    for name, (unit, frame, meaning) in _POSE.items()
}

COLUMNS: Mapping[str, Mapping[str, Column]] = {
    "scans": {
        "scan": ("", "", "number of the scan, from 0"),
        "evaluated": ("targets", "", "targets whose physics was evaluated"),
        "detected": ("", "", "detections, false alarms included"),
        "skipped_absent": ("targets", "", "left out: not there"),
        "skipped_off": ("targets", "", "left out: the sensor is off"),
        "skipped_field_of_view": ("targets", "", "left out: outside the field of view"),
        "skipped_range": ("targets", "", "left out: beyond the range"),
        "skipped_hidden": ("targets", "", "left out: the Earth or its ground stands before it"),
        "skipped_culled": ("targets", "", "left out: too far away for any sensor"),
    },
    "detections": {
        "scan": ("", "", "number of the scan"),
        "target": ("", "", "name of the target; null for a false alarm"),
        **_MEASURED,
        "confidence": ("dB or signature", "", "margin of the detection, by the kind of sensor"),
        **_TRUE,
        "snr_db": (
            "dB",
            "",
            "signal-to-noise ratio that a radar measured; the mean stands in looks",
        ),
        "detection_probability": (
            "",
            "",
            "probability of it, where a sensor of one's own says it; looks has that of all",
        ),
        "pixels": ("pixels", "", "pixels that the target covers in a camera"),
        "declared": ("", "", "whether there are enough detections; true without a rule"),
        "cued": ("", "", "whether the target lay in a cue cone; false where no cues come"),
        "illuminated_s": ("s", "", "when a sweeping beam lit the target"),
        "ned_azimuth_rad": ("rad", _NED, "azimuth from north, by the believed attitude"),
        "ned_elevation_rad": ("rad", _NED, "elevation, by the believed attitude"),
        **_POSE,
        **_ERRORS,
        **_OWN_VELOCITY,
    },
    "fused": {
        "target": ("", "", "name of the target"),
        "sensors": ("", "", "sensors that were fused, joined by +"),
        **_MEASURED,
        "angle_source": ("", "", "sensor that the angles are of"),
        "range_source": ("", "", "sensor that the range is of; null without one"),
        **_TRUE,
        "measured_s": ("s", "", "when the angles were measured; all that is true is of then"),
        **_ERRING_POSE,
        **_ERRORS,
    },
    "tracks": {
        "target": ("", "", "name of the target"),
        **_MEASURED,
        "age_s": ("s", "", "time since what is held was measured"),
        "updated_by": ("", "", "sensors of that update, joined by +"),
        "measured_s": ("s", "", "when it was measured"),
        **_ERRING_POSE,
    },
    "state_tracks": {
        "track": ("", "", "the tracker's own number of the track, from 1"),
        "track_status": ("", "", "tentative, confirmed, coasted, or deleted (told once)"),
        "existence": ("", "", "probability that there is something"),
        **{
            f"{axis}_m{per_s}": (unit, _FRAME, f"estimated {what}; null without a range")
            for per_s, unit, what in (("", "m", "position"), ("_s", "m/s", "velocity"))
            for axis in ("north", "east", "down")
        },
        "azimuth_rad": ("rad", _FRAME, "direction from the ownship at its last look, from north"),
        "elevation_rad": ("rad", _FRAME, "its elevation, upward"),
        "azimuth_variance_rad2": ("rad²", _FRAME, "variance of that azimuth"),
        "elevation_variance_rad2": ("rad²", _FRAME, "variance of that elevation"),
        "has_range": ("", "", "whether any range was measured"),
        "age_s": ("s", "", "time since the track was started"),
        "state_s": ("s", "", "the instant that the state speaks of"),
        "updated_s": ("s", "", "when the last measurement in it was made"),
        "contributors": ("", "", "sensors that ever updated it, joined by +"),
        "updated_by": ("", "", "sensors of its last update, joined by +"),
        **{
            f"own_{axis}_m": ("m", _FRAME, f"where the ownship believed to be then, {axis}")
            for axis in ("north", "east", "down")
        },
        "nis": ("", "", "normalised innovations squared at that instant, added up; null without"),
        "nis_freedom": ("", "", "how many measured quantities they are of"),
        "origin_lat_deg": ("deg", _WGS84, "origin of the frame: latitude"),
        "origin_lon_deg": ("deg", _WGS84, "its longitude"),
        "origin_alt_m": ("m", _WGS84, "its height above the ellipsoid"),
        **{
            name: (
                ("m²", "m²/s", "m²/s²")[(i > 2) + (j > 2)],
                _FRAME,
                f"covariance of {_STATE[i]} with {_STATE[j]}; null without a range",
            )
            for (i, j), name in COVARIANCE.items()
        },
        **{
            f"acceleration_{axis}_m_s2": ("m/s²", _FRAME, f"estimated acceleration {axis}")
            for axis in ("north", "east", "down")
        },
        "turn_rate_rad_s": ("rad/s", _FRAME, "estimated rate of turn, positive to the right"),
        "probability_velocity": ("", "", "of the model of constant velocity"),
        "probability_turn": ("", "", "of the model of a coordinated turn"),
        "probability_acceleration": ("", "", "of the model of constant acceleration"),
    },
    "cues": {
        "track": ("", "", "number of the track that it comes from"),
        "azimuth_rad": ("rad", _FRAME, "axis of the cone as seen from the ownship, from north"),
        "elevation_rad": ("rad", _FRAME, "its elevation, upward"),
        "half_angle_rad": ("rad", "", "half angle of the cone"),
        "has_range": ("", "", "whether the track has a range"),
        **{
            f"{axis}_m{per_s}": (unit, _FRAME, f"{what} that it speaks of; null without a range")
            for per_s, unit, what in (("", "m", "position"), ("_s", "m/s", "velocity"))
            for axis in ("north", "east", "down")
        },
        "origin_lat_deg": ("deg", _WGS84, "origin of the frame: latitude"),
        "origin_lon_deg": ("deg", _WGS84, "its longitude"),
        "origin_alt_m": ("m", _WGS84, "its height above the ellipsoid"),
        "state_s": ("s", "", "the instant that it speaks of"),
        "until_s": ("s", "", "the last instant at which it counts"),
    },
    "truth": {
        "target": ("", "", "name of the target; null for the ownship"),
        "lat_deg": ("deg", _WGS84, "latitude"),
        "lon_deg": ("deg", _WGS84, "longitude"),
        "alt_m": ("m", _WGS84, "height above the ellipsoid"),
        "velocity_north_m_s": ("m/s", _OWN_NED, "velocity over ground, north"),
        "velocity_east_m_s": ("m/s", _OWN_NED, "east"),
        "velocity_down_m_s": ("m/s", _OWN_NED, "down"),
        "heading_rad": ("rad", _TURNED, "where the nose points, from north"),
        "pitch_rad": ("rad", _TURNED, "pitch, nose up"),
        "roll_rad": ("rad", _TURNED, "roll, right wing down"),
    },
    "looks": {
        "scan": ("", "", "number of the scan"),
        "target": ("", "", "name of the target"),
        "evaluated": ("", "", "whether its physics was evaluated: all else is null without"),
        "detected": ("", "", "whether it was detected"),
        **_TRUE,
        "confidence": ("dB or signature", "", "margin that decided, by the kind of sensor"),
        "snr_db": ("dB", "", "mean signal-to-noise ratio of a radar, or that of a sampled RCS"),
        "detection_probability": ("", "", "probability with which the detection was drawn"),
        "pixels": ("pixels", "", "pixels that the target covers in a camera"),
    },
    "alerts": {
        "target": ("", "", "name of the target; of a track, the nearest one, null if far from all"),
        "track": ("", "", "the tracker's number; null where tracks have none"),
        "level": ("", "", "alert level, 0 without an alert"),
        **{
            f"time_to_level_{level}_s": (
                "s",
                "",
                f"time to the volume of level {level} in straight flight, 0 inside; null where it "
                "is not met within the lookahead",
            )
            for level in range(1, 5)
        },
        "time_to_closest_s": ("s", "", "time to the horizontal closest approach, 0 if past"),
        "closest_horizontal_m": ("m", "", "projected horizontal distance there"),
        "closest_vertical_m": ("m", "", "projected least difference in height"),
    },
    "manoeuvres": {
        "turn_rad": ("rad", "", "commanded change of heading, positive to the right"),
        "rate_rad_s": ("rad/s", "", "rate of that turn"),
        "climb_m": ("m", "", "commanded change of altitude, positive upward"),
        "climb_rate_mps": ("m/s", "", "vertical speed of that climb or descent"),
        "speed_mps": ("m/s", "", "commanded change of ground speed"),
        "acceleration_mps2": ("m/s²", "", "acceleration of that change"),
        "vertical_speed_mps": ("m/s", "", "commanded change of vertical speed, positive upward"),
        "vertical_acceleration_mps2": ("m/s²", "", "acceleration of that change"),
    },
    "bands": {
        "band": ("", "", "direction or altitude: what it is a stretch of"),
        "region": ("", "", "FAR, MID or NEAR: whose volumes are met; RECOVERY: what leads out"),
        "low_rad": ("rad", "", "direction over the ground from north at which it begins"),
        "high_rad": ("rad", "", "direction, clockwise, at which it ends"),
        "low_m": ("m", "", "altitude at which it begins"),
        "high_m": ("m", "", "altitude at which it ends"),
    },
    "decisions": {
        "decision": (
            "",
            "",
            "shown, looked, verified, rejected, turn or climb: an alert was on the operator's "
            "screen, was looked at, was judged, or the ownship was told to manoeuvre",
        ),
        "target": ("", "", "name of the target it is about; null for none"),
        "turn_rad": ("rad", "", "commanded change of heading, positive to the right"),
        "climb_m": ("m", "", "commanded change of altitude, positive upward"),
        "level": ("", "", "alert level of the target as the operator had it, 0 without an alert"),
        "alert_s": ("s", "", "when that alert came to the operator; null without an alert"),
        "response_s": ("s", "", "time from then to the decision; null without an alert"),
        "wall_time_s": (
            "s",
            "",
            "seconds since 1970-01-01T00:00Z by the wall clock when the decision came from a "
            "person; null where none did",
        ),
    },
    "processing": {
        "processor": ("", "", "shared processor"),
        "entered_s": ("s", "", "when the message came to the processor"),
        "started_s": ("s", "", "when work on it began; null if never"),
        "age_s": ("s", "", "from when it was handed in to its delivery"),
        "queue_length": ("messages", "", "messages that waited behind it at its outcome"),
        "outcome": ("", "", "whether it was done, dropped or skipped"),
    },
}

#: The same with what every table begins with: metadata of the recorded tables.
DESCRIBED: Mapping[str, Mapping[str, Column]] = {
    table: {**LEADING, **columns} for table, columns in COLUMNS.items()
}
