"""Bands as the published rules have them, one state and one manoeuvre at a time, in plain loops."""

import math
import struct

import numpy as np

REGIONS = ("NONE", "FAR", "MID", "NEAR", "RECOVERY")
#: A volume that nobody meets.
NOTHING = ("cylinder", 0.0, 0.0, 0.0, 0.0)


def near(a, b, apart=16348, tiny=1e-13):
    """Tell whether two numbers are at most so many doubles apart, or both tiny if one is 0."""
    if a == 0 or b == 0:
        return abs(a) < tiny and abs(b) < tiny
    bits = [struct.unpack("=q", struct.pack("=d", abs(x)))[0] for x in (a, b)]
    return (a > 0) == (b > 0) and abs(bits[0] - bits[1]) <= apart


def circle(s, v, d):
    """Return when the line s + t v is within a circle, None if it is never."""
    a, p, q = v @ v, s @ v, s @ s
    delta = d * d * a - (s[0] * v[1] - s[1] * v[0]) ** 2
    if a == 0 or delta < 0:
        return None
    root = math.sqrt(p * p - a * (q - d * d)) if p * p > a * (q - d * d) else 0.0
    return (-p - root) / a, (-p + root) / a


def conflict(volume, own, other, begin, end):
    """Tell whether two straight flights (east, north, up, rates) meet a volume in [begin, end]."""
    if not begin < end:
        return False
    rel = np.subtract(own, other)
    s, z, v, w = rel[:2], rel[2], rel[3:5], rel[5]
    kind, d, h, tau, tcoa = volume
    reach = h if kind == "cylinder" else max(h, tcoa * abs(w))
    if abs(w) < 1e-13:
        low, up = (begin, end) if abs(z) < h or (abs(z) == h and kind != "cylinder") else (1, 0)
    else:
        side = math.copysign(1.0, w)
        low, up = (-side * reach - z) / w, (side * h - z) / w
        low, up = max(low, begin), min(up, end)
    if low >= up or near(low, up):
        return False
    ring, a = circle(s, v, d), v @ v
    if kind == "cylinder":
        if max(abs(v)) < 1e-13:
            return s @ s < d * d
        first, last = ring if ring and ring[1] > ring[0] else (1, 0)
        first, last = max(first, low), min(last, up)
        return first < last and not near(first, last)
    s = s + low * v
    p, q, room, ring = s @ v, s @ s, up - low, circle(s, v, d)
    if q <= d * d:
        first, last = 0.0, room if a < 1e-13 else min(room, ring[1])
    elif p >= 0 or ring is None:
        return False
    else:
        if kind == "modified_tau":
            b, c = 2 * p + tau * a, q + tau * p - d * d
            if b * b < 4 * a * c:
                return False
            first = (-b - math.sqrt(b * b - 4 * a * c)) / (2 * a)
        else:
            first = min(ring[0], -p / a - tau) if kind == "time_to_closest" else ring[0] - tau
        if first > room:
            return False
        first, last = max(0.0, first), min(room, ring[1])
    return low + first < low + last and not near(low + first, low + last)


def meets(volume, own, other, begin, start, end):
    """Tell whether flights meet a volume from `begin` or `start` on, at `end` if that is when."""
    if begin == end >= start:
        end += 1e-7 * max(1.0, end)
    return conflict(volume, own, other, max(begin, start), end)


class Plain:
    """The manoeuvres of one kind of one ownship (six numbers), and what keeps them clear."""

    def __init__(self, kind, values, own):
        self.kind, self.values, self.own = kind, values, np.array(own, dtype=float)
        self.ahead = values["lookahead_time"]
        # Whether horizons count from now, not from the end of a manoeuvre.
        self.from_now = values["bands_add_time_to_maneuver"]
        speed, track = math.hypot(own[3], own[4]), math.atan2(own[3], own[4])
        self.now = {"hdir": track % (2 * math.pi), "hs": speed, "vs": own[5], "alt": own[2]}[kind]
        self.step = values[f"step_{kind}"]
        self.rate = {
            "hdir": values["turn_rate"],
            "hs": values["horizontal_accel"],
            "vs": values["vertical_accel"],
        }.get(kind, 0.0)
        if kind == "hdir":
            count = math.ceil(math.pi / self.step)
            self.down = self.up = count - (count * self.step > math.pi)
            self.least, self.most = 0.0, 2 * math.pi
        else:
            self.least, self.most = values[f"min_{kind}"], values[f"max_{kind}"]
            self.down = max(0, math.ceil((self.now - self.least) / self.step))
            self.up = max(0, math.ceil((self.most - self.now) / self.step))
        self.numbers = list(range(-self.down, self.up + 1))
        if kind == "alt":
            self.numbers = list(range(math.floor((self.most - self.least) / self.step) + 2))
        self.at = [
            (self.least if kind == "alt" else self.now) + k * self.step for k in self.numbers
        ]

    def tangent(self, k):
        """Return when k steps end, and the straight flight then, run back to time 0."""
        time_s = abs(k) * self.step / self.rate
        end = self.own.copy()
        east, north, _, v_east, v_north, climb = self.own
        speed, track, side = math.hypot(v_east, v_north), math.atan2(v_east, v_north), np.sign(k)
        end[2] += climb * time_s
        if self.kind == "hdir":
            speed = max(speed, self.values["step_hs"], self.values["min_airspeed"])
            new, radius = track + k * self.step, speed / self.rate * side
            end[0] = east + radius * (math.cos(track) - math.cos(new))
            end[1] = north + radius * (math.sin(new) - math.sin(track))
            end[3:5] = speed * math.sin(new), speed * math.cos(new)
        else:
            gain = k * self.step if self.kind == "hs" else 0.0
            way = speed * time_s + 0.5 * gain * time_s
            end[0], end[1] = east + way * math.sin(track), north + way * math.cos(track)
            end[3:5] = (speed + gain) * math.sin(track), (speed + gain) * math.cos(track)
            if self.kind == "vs":
                end[2] += 0.5 * k * self.step * time_s
                end[5] += k * self.step
        end[:3] -= end[3:] * time_s
        return time_s, end

    def end(self, horizon, time_s):
        """Return until when the flight after a manoeuvre of so long is looked at."""
        return min(self.ahead, horizon if self.from_now else horizon + time_s)

    def red(self, volume, other, begin, horizon, keep=None):
        """Tell which steps meet a volume from `begin` on, or another one until then."""
        if self.kind == "alt":
            return [self.altitude_red(t, volume, other, begin, horizon, keep) for t in self.at]
        step_s, ahead, found = self.step / self.rate, self.ahead, {}
        until = min(ahead, begin, horizon)
        for side, most in ((-1, self.down), (1, self.up)):
            lost = False
            for k in range(most + 1):
                time_s, own = self.tangent(side * k)
                last_s = min(ahead, horizon) if self.from_now else ahead
                asked = math.ceil(begin / step_s) <= k <= math.floor(last_s / step_s)
                if asked and time_s < ahead:
                    lost |= conflict(volume, own, other, time_s, time_s + step_s)
                if keep and k <= math.floor(until / step_s):
                    lost |= conflict(keep, own, other, time_s, time_s + step_s)
                bad = meets(volume, own, other, begin, time_s, self.end(horizon, time_s))
                if keep and self.from_now and time_s > horizon:
                    bad |= conflict(keep, own, other, 0.0, horizon)
                elif keep:
                    bad |= conflict(keep, own, other, time_s, until)
                found[side * k] = found.get(side * k, False) or lost or bad
        return [found[k] for k in self.numbers]

    def altitude_red(self, target, volume, other, begin, horizon, keep):
        """Tell whether a level-off at a target meets a volume; see `red`."""
        push, rate, ahead = self.values["vertical_accel"], self.values["vertical_rate"], self.ahead
        up, climb = self.own[2], self.own[5]
        # Pieces of (duration, acceleration): brake first where it goes away or would overshoot.
        first, gap, start = [], target - up, climb
        if climb * gap < 0 or climb * climb / (2 * push) > abs(gap):
            first = [(abs(climb) / push, -math.copysign(push, climb))]
            gap, start = gap - climb * abs(climb) / (2 * push), 0.0
        side = 1.0 if gap >= 0 else -1.0
        fast = max(rate, abs(start))
        free = abs(gap) - (2 * fast * fast - start * start) / (2 * push)
        if free < 0:
            fast, free = math.sqrt(max(push * abs(gap) + start * start / 2, 0.0)), 0.0
        pieces = [*first, ((fast - abs(start)) / push, side * push)]
        t1 = sum(d for d, _ in pieces)
        t2 = t1 + (free / fast if fast > 0 else 0.0)
        t3 = t2 + fast / push
        pieces += [(t2 - t1, 0.0), (t3 - t2, -side * push)]

        def flight(time_s):
            """Return the straight flight at a time, run back to 0."""
            z, w, left = up, climb, time_s
            for lasts, change in pieces:
                part = min(left, lasts)
                z, w, left = z + w * part + 0.5 * change * part**2, w + change * part, left - part
            if time_s >= t3:
                z, w = target, 0.0
            return np.array([*self.own[:2], z - w * time_s, *self.own[3:5], w])

        def inside(what, time_s):
            """Tell whether a volume is met at once."""
            own = flight(time_s)
            return conflict(what, own, other, time_s, time_s + 1e-7 * max(1.0, time_s))

        seconds = [*range(math.floor(t1) + 1), *range(math.ceil(t2), math.floor(t3 + 1) + 1)]
        for time_s in (float(n) for n in seconds if n < ahead):
            due = time_s <= horizon or not self.from_now
            if due and time_s >= begin and inside(volume, time_s):
                return True
            if keep and time_s <= min(begin, horizon) and inside(keep, time_s):
                return True
        for start_s, end_s in ((t1, t2), (t3 + 1, math.inf)):
            own, last = flight(start_s), min(end_s, ahead)
            late = self.from_now and start_s == t3 + 1 > horizon
            if keep and late and conflict(keep, own, other, 0.0, horizon):
                return True
            if start_s >= ahead:
                continue
            end_s = min(self.end(horizon, start_s), last)
            if meets(volume, own, other, begin, start_s, end_s):
                return True
            if keep and conflict(keep, own, other, start_s, min(begin, horizon, last)):
                return True
        return False

    def intervals(self, red):
        """Return the intervals of values without a red one."""
        found, start = [], None
        for place in range(len(red) + 1):
            clear = place < len(red) and not red[place]
            if clear and start is None:
                start = place
            elif not clear and start is not None:
                low, high = self.at[start], self.at[place - 1]
                if place - start > 1 and self.kind == "hdir":
                    found.append((low, high))
                elif place - start > 1 and max(low, self.least) < min(high, self.most):
                    found.append((max(low, self.least), min(high, self.most)))
                start = None
        return found

    def region_of(self, value, layers):
        """Return the region in which a value lies: the last layer that holds it wins."""
        found = "NONE"
        for region, spans, outside in layers:
            turns = (-2 * math.pi, 0.0, 2 * math.pi) if self.kind == "hdir" else (0.0,)
            if any(low <= value + t <= high for low, high in spans for t in turns) != outside:
                found = region
        return found

    def layers(self, levels, others, early):
        """Return what is painted from the bottom up, with the recovery (time, shrinks) or None.

        Levels are (region, volume, alerting time, early alerting time), by number from 1.
        """
        found, corrective, stuck = [], REGIONS.index(self.values["corrective_region"]), False
        for region in ("NEAR", "MID", "FAR"):
            number = next((n for n, one in enumerate(levels, 1) if one[0] == region), None)
            if number is None:
                continue
            _, volume, *times = levels[number - 1]
            red = [False] * len(self.at)
            concerned = []
            for other, level in zip(others, early, strict=True):
                due = times[1] if level == number else times[0]
                # In time: it meets the volume, flown straight, before it is due.
                if conflict(volume, self.own, other, 0.0, self.ahead) and self.begins_before(
                    volume, other, due
                ):
                    horizon = self.ahead
                else:
                    horizon = min(times[0], self.ahead)
                    if not any(self.soon(volume, other, horizon)):
                        continue
                concerned.append(other)
                red = [
                    a or b for a, b in zip(red, self.red(volume, other, 0.0, horizon), strict=True)
                ]
            spans = self.intervals(red)
            found.insert(0, (region, spans, True))
            if REGIONS.index(region) == corrective:
                self.concerned, self.volume = concerned, volume
            if not spans:
                stuck = REGIONS.index(region) >= corrective
                break
        if not stuck or not self.values[f"recovery_{self.kind}"]:
            return found, None
        number = next(
            n for n, one in enumerate(levels) if one[0] == self.values["corrective_region"]
        )
        return self.recovery(found, levels[number], others, early, number + 1)

    def begins_before(self, volume, other, due):
        """Tell whether a volume is met now or before a time."""
        low, high = 0.0, self.ahead
        if conflict(volume, self.own, other, 0.0, 1e-9):
            return True
        for _ in range(60):
            middle = 0.5 * (low + high)
            if conflict(volume, self.own, other, 0.0, middle):
                high = middle
            else:
                low = middle
        return high < due

    def soon(self, volume, other, horizon):
        """Tell which steps meet a volume after them, those of altitudes also on the way."""
        if self.kind == "alt":
            return self.red(volume, other, 0.0, horizon)
        found = []
        for k in self.numbers:
            time_s, own = self.tangent(k)
            found.append(conflict(volume, own, other, time_s, self.end(horizon, time_s)))
        return found

    def recovery(self, layers, level, others, early, number):
        """Return the layers with the ways out, and the recovery (time, shrinks)."""
        values, ahead = self.values, self.ahead
        volume, others = level[1], self.those_of(level, others, early, number)
        nmac = values["horizontal_nmac"], values["vertical_nmac"]
        sizes = values["min_horizontal_recovery"], values["min_vertical_recovery"]

        def clear_of(what, begin=0.0, keep=None):
            red = [False] * len(self.at)
            for other, horizon in others:
                every = [self.red(what, other, begin, horizon, keep)]
                if begin > horizon:  # only the cylinder, as far as the horizon
                    every = [
                        self.red(keep, other, 0.0, horizon),
                        self.red(NOTHING, other, horizon, horizon, keep),
                    ]
                red = [any(each) for each in zip(red, *every, strict=True)]
            return self.intervals(red)

        if not clear_of(("cylinder", *nmac, 0, 0)):
            return layers, (-math.inf, 0)
        shrinks = 0
        while True:
            keep = ("cylinder", *sizes, 0, 0)
            if clear_of(keep):
                red, green, probe = 0.0, ahead + 1, ahead
                while green - red > 0.5:
                    if clear_of(volume, probe, keep):
                        green = probe
                    else:
                        red = probe
                    probe = 0.5 * (red + green)
                at = red
                if green <= ahead:
                    at = min(ahead, green + values["recovery_stability_time"])
                ways = clear_of(volume, at, keep)
                if ways:
                    return [*layers, ("RECOVERY", ways, False)], (at, shrinks)
            if not values["ca_bands"]:
                return layers, (-math.inf, shrinks)
            sizes = tuple(
                max(least, size * (1 - values["ca_factor"]))
                for least, size in zip(nmac, sizes, strict=True)
            )
            shrinks += 1
            if sizes == nmac:
                return layers, (-math.inf, shrinks)

    def those_of(self, level, others, early, number):
        """Return the intruders whose corrective volume counts, each with its horizon."""
        _, volume, usual, earlier = level
        found = []
        for other, on in zip(others, early, strict=True):
            due, horizon = earlier if on == number else usual, min(usual, self.ahead)
            ahead = conflict(volume, self.own, other, 0.0, self.ahead)
            if ahead and self.begins_before(volume, other, due):
                found.append((other, self.ahead))
            elif any(self.soon(volume, other, horizon)):
                found.append((other, horizon))
        return found
