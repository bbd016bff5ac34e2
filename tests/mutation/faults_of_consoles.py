"""Faults of the operator's console and display: who is let in, what is decided, what is where."""

from fault import in_file

_GROUP = "consoles"
_CONSOLE = "wiring/test_console.py"
_PICTURE = "cdti/test_picture.py"
_ADMISSION = "cdti/test_admission.py"
_SESSION = "cdti/test_session.py"
_MESSAGES = "cdti/test_page_messages.py"
_SHOWN = "wiring/test_what_the_display_shows.py"
_LOST = "wiring/test_contacts_that_are_lost.py"
_CAMERA = "wiring/test_the_display_s_camera.py"
_WHOLE = "cdti/test_session.py::test_a_whole_session_and_its_replay"

FAULTS = [
    *in_file(
        _GROUP, "components/operator/console.py", _CONSOLE,
        ("response-from-the-start", "ticks / per_s - began,", "ticks / per_s,"),
        ("alert-begins-anew-at-every-row", "tick if began is None else began.tick", "tick"),
        ("turn-flown-at-another-rate", "math.radians(self.p.turn_rate_deg_s)",
         "math.radians(3.0)"),
        ("climb-flown-at-another-rate", "climb_rate_mps=self.p.vertical_rate_mps",
         "climb_rate_mps=2.54"),
    ),
    *in_file(
        _GROUP, "components/operator/recorded.py", _CONSOLE,
        ("recorded-decision-a-scan-late", 'scans[-1], side="right"', 'scans[-1], side="left"'),
    ),
    *in_file(
        _GROUP, "components/operator/decision_table.py", _CONSOLE,
        ("decisions-in-any-order", "read.time_s < found[-1][0]", "read.time_s < 0.0"),
        ("wall-time-forgotten", "turn_rad, climb_m, self.wall_time_s)", "turn_rad, climb_m)"),
    ),
    *in_file(
        _GROUP, "components/cdti/admission.py", _ADMISSION,
        ("token-decides-twice", "self._fresh = False\n            self._key",
         "self._fresh = True\n            self._key"),
        ("any-key-decides", "if self._key and _same(key, self._key):", "if self._key and key:"),
    ),
    *in_file(
        _GROUP, "components/cdti/server.py", _SESSION,
        ("any-origin", '!= [f"http://{self.authority}"]:', "== []:"),
        ("any-host", "if hosts != [self.authority]:", "if not hosts:"),
        ("pictures-without-end", "if self._sent - self._drawn >= _AHEAD:", "if False:"),
    ),
    *in_file(
        _GROUP, "components/cdti/crew.py", _SESSION,
        ("who-watches-decides", "if page.role != OPERATOR:", "if False:"),
        ("decision-said-again-counts-twice", "if known is not None:", "if known == 1:"),
        ("run-never-pauses", "return self._pauses and self._operators == 0", "return False"),
    ),
    *in_file(
        _GROUP, "components/cdti/page_messages.py", _MESSAGES,
        ("anything-more-is-taken", 'extra="forbid", strict=True', "strict=True"),
        ("text-for-a-number", 'extra="forbid", strict=True', 'extra="forbid"'),
    ),
    *in_file(
        _GROUP, "components/cdti/contacts.py", _PICTURE,
        ("range-held-for-ever", "<= RANGE_HELD_S]", "<= 1e9]"),
        ("contact-from-an-unbanked-ownship", "body_to_ned(*body, *pose[:, 3:].T)",
         "body_to_ned(*body, pose[:, 3], 0.0 * pose[:, 3], 0.0 * pose[:, 3])"),
    ),
    *in_file(
        _GROUP, "components.cdti.scope.py", _PICTURE,
        ("loss-as-if-the-ownship-stood", "- own_mps[0]\n", "\n"),
    ),
    *in_file(
        _GROUP, "components.cdti.camera.py", _PICTURE,
        ("picture-that-does-not-roll", "_body_to_ned(own_attitude_rad).T",
         "_body_to_ned(own_attitude_rad * np.array([1.0, 1.0, 0.0])).T"),
        ("plate-as-deep-as-wide", "areas.horizontal_m2 * PLATE_ASPECT_RATIO",
         "areas.horizontal_m2 * 1.0"),
    ),
    *in_file(
        _GROUP, "components/operator/console.py", _CONSOLE,
        ("level-of-whoever-is-worst", "int(level[place]), tick if", "int(level.max()), tick if"),
        ("alert-of-when-it-was-sent", "entries, int(arrived.tick[place]))",
         "entries, int(alerts.tick[place]))"),
        ("alert-that-comes-with-the-decision-is-missed", 'until, side="right"))',
         'until, side="left"))'),
        ("descents-are-not-flown", "abs(decision.climb_m) >= _LEAST_CLIMB_M",
         "decision.climb_m >= _LEAST_CLIMB_M"),
    ),
    *in_file(
        _GROUP, "components/cdti/crew.py", _WHOLE,
        ("turns-to-the-other-side", "turn_rad=math.radians(value)",
         "turn_rad=-math.radians(value)"),
        ("climbs-are-lost", "climb_m=value if kind == CLIMB else 0.0", "climb_m=0.0"),
    ),
    *in_file(
        _GROUP, "components/cdti/session.py", _WHOLE,
        ("replay-at-other-rates", "if key in RecordedOperator.Parameters.model_fields",
         'if key == "scan_rate_hz"'),
    ),
    *in_file(
        _GROUP, "components/cdti/contacts.py", _SHOWN,
        ("contacts-by-their-place", "TRACKS_FROM + message.track[lives]", "TRACKS_FROM + lives"),
        ("tracks-upside-down", "-message.down_m[with_range]", "message.down_m[with_range]"),
    ),
    *in_file(
        _GROUP, "components/cdti/scope.py", _SHOWN,
        ("flights-relative-to-the-ownship",
         "alerts.own_mps[:, np.newaxis] - alerts.relative[3:]", "-alerts.relative[3:]"),
        ("flight-of-another-contact", "flights.get(one[0], _UNKNOWN)", "flights.get(0, _UNKNOWN)"),
        ("level-of-another-contact", "level.get(one[0], 0)",
         "max(level.values(), default=0)"),
        ("alert-since-the-last-row", "self._since.get(t, tick / self._per_s)",
         "tick / self._per_s"),
        ("rules-of-the-first-alerter", "configuration.alerters[component.p.alerter - 1]",
         "configuration.alerters[0]"),
        ("sector-of-an-unturned-radar", "math.degrees(edge) + turned_deg", "math.degrees(edge)"),
        ("bands-for-ever", "> BANDS_LAST_S", "> 1e9"),
        ("camera-looks-at-the-first-contact", "contacts.toward[place[0]]", "contacts.toward[0]"),
    ),
    *in_file(
        _GROUP, "components/cdti/camera_sights.py", _CAMERA,
        ("picture-from-twice-as-far", "message.true_range_m[real],\n",
         "2.0 * message.true_range_m[real],\n"),
        ("picture-of-the-oldest-camera", "name = max(names", "name = min(names"),
        ("pitch-for-roll", "np.array([own.heading_rad, own.pitch_rad, own.roll_rad])",
         "np.array([own.heading_rad, own.roll_rad, own.pitch_rad])"),
        ("picture-of-long-ago-is-of-a-track", "time_s - seen[:, 0] < LATELY_S",
         "time_s - seen[:, 0] < 1e9"),
        ("attitude-of-the-first-target", '_rad")[-1, place]', '_rad")[-1, 0]'),
        ("attitude-of-the-window-s-start", '_rad")[-1, place]', '_rad")[0, place]'),
        ("contrast-of-the-margin", "(margin + camera.detector.threshold) / strength",
         "margin / strength"),
        ("pixels-across-for-pixels-up", "camera.pixel_azimuth_rad, camera.pixel_elevation_rad",
         "camera.pixel_elevation_rad, camera.pixel_azimuth_rad"),
        ("infrared-picture-of-daylight-areas", "aircraft.ir if camera.areas",
         "aircraft.eo if camera.areas"),
    ),
    *in_file(
        _GROUP, "components.cdti.camera.py", _CAMERA,
        ("horizon-of-a-bank-to-the-other-side", "-_body_to_ned(own_attitude_rad)[2]",
         "-_body_to_ned(own_attitude_rad * np.array([1.0, 1.0, -1.0]))[2]"),
        ("horizon-above-the-level", "missing = -math.sin(dip_rad)",
         "missing = math.sin(dip_rad)"),
        ("horizon-tilts-the-other-way", "math.atan2(across, upright)",
         "math.atan2(-across, upright)"),
    ),
    *in_file(
        _GROUP, "components/cdti/contacts.py", (_LOST, _SHOWN),
        ("track-seen-whenever-it-is-told", "message.updated_s[lives]", "message.state_s[lives]"),
        ("deleted-tracks-are-shown", "np.flatnonzero(message.track_status != DELETED)",
         "np.flatnonzero(message.track_status >= 0)"),
        ("lines-from-where-the-ownship-is-now", "own.poses(message.measured_tick)",
         "own.poses(message.measured_tick + 10**12)"),
        ("who-is-not-fused-now-is-lost", "stays = ~np.isin(before.number, found.number)",
         "stays = np.zeros(len(before.number), dtype=bool)"),
    ),
    *in_file(
        _GROUP, "components.cdti.contacts.py", _SHOWN,
        ("flight-before-this-message-forgotten", "keep = self._tick < states.tick[0]",
         "keep = self._tick < -1"),
    ),
    *in_file(
        _GROUP, "components/cdti/scope.py", _SHOWN,
        ("time-to-the-last-loss", "np.fmin.reduce(times)", "np.fmax.reduce(times)"),
        ("area-of-all-targets", "alerts.relative[:, on]", "alerts.relative"),
    ),
    *in_file(
        _GROUP, "components/cdti/session.py", _WHOLE,
        ("replay-without-the-console-s-latency", "**kept, **options,", "**kept,"),
    ),
    *in_file(
        _GROUP, "components/operator/desk.py", _CONSOLE,
        ("only-the-last-decision-counts", "for laid in found]", "for laid in found[-1:]]"),
    ),
    *in_file(
        _GROUP, "components/operator/human.py", _CONSOLE,
        ("decision-at-the-wake-s-first-instant", "wake.ticks[-1]", "wake.ticks[0]",
         "a block that is not windowed is woken at one instant at a time"),
    ),
    *in_file(
        _GROUP, "components/operator/console.py", _CONSOLE,
        ("all-told-with-the-first-decision", "told = [(tick, self._told(d))",
         "told = [(made[0][0], self._told(d))"),
    ),
    *in_file(
        _GROUP, "components/operator/recorded.py", _CONSOLE,
        ("decision-at-the-scan-before-it", "self._ticks[first : self._next])]",
         'self._ticks[first : self._next], side="right") - 1]'),
    ),
    *in_file(
        _GROUP, "components/view/sensor_marks.py", "view/test_page.py",
        ("sensors-of-a-kind-alike", "_SHADES[again % len(_SHADES)]", "_SHADES[0]"),
        ("shades-that-fade-into-their-ground", "< _LIGHT else -1)", "< _LIGHT else 1)"),
    ),
]  # fmt: skip
