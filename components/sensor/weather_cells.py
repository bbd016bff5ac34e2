"""What of a sensor's lines of sight lies in the scene's cells of rain and fog."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from components.aircraft.known_targets import KnownTraffic
from components.environment.weather_cells import WeatherCell, Within
from components.sensor.look import Cells
from dsa_des.arrays.types import FloatArray
from dsa_des.block.effect import Verdict
from dsa_des.time.clock import NANOSECONDS

# Ranges by models of the Earth, and what turns between two samples, are within it.
_MARGIN, _MARGIN_M = 1.01, 100.0


def weather_cells(block: Any) -> tuple[WeatherCell, ...]:
    """Return the weather cells (rain, cloud) in the scene of a block; empty without weather."""
    weather = block.context.sections.get("weather")
    cells: tuple[WeatherCell, ...] = () if weather is None else weather.cells
    return cells


def weather_cells_verdict(block: Any) -> Verdict:
    """Return whether a weather cell can come near this sensor's lines of sight, and why."""
    cells = weather_cells(block)
    if not cells:
        return Verdict(False, "[weather] has no cells")
    apart_m = _min_cell_distances_m(block)
    if apart_m is None:
        return Verdict(True, f"[weather] has {len(cells)} cells, and flights may go anywhere")
    near = [str(number) for number, metres in enumerate(apart_m) if metres <= 0.0]
    if near:
        return Verdict(True, f"[weather] cells {', '.join(near)} may meet lines of sight")
    if min(apart_m) == math.inf:
        return Verdict(False, "no target comes in reach: no cell meets a line of sight")
    least_km = 1e-3 * min(apart_m)
    why = f"no cell comes near any line of sight: the nearest stays {least_km:.3g} km away"
    return Verdict(False, why)


def _min_cell_distances_m(block: Any) -> list[float] | None:
    """Return for each weather cell a lower bound of its horizontal distance to all lines of sight,
    m; None if flights are not known.
    """
    offers = [producer.offer for producer in block.context.producers]
    known = [offer for offer in offers if isinstance(offer, KnownTraffic)]
    # Other runs beside this one may have other flights.
    if not known or block.context.recorded_runs > 1:
        return None
    lasts_s = float(1 / block.p.scan_rate_hz)
    apart_m = []
    for offer in known:
        envelope = offer.envelope(block.stated_reach.range_max_m, lasts_s)
        if envelope is None:
            return None
        path = envelope.own_path
        farthest_m = _MARGIN * envelope.range_m + _MARGIN_M if envelope.range_m else -math.inf
        for cell in weather_cells(block):
            level_m = np.hypot(*cell.centre_offset_m(path.place, path.time_s))
            moves_m = path.moves_m + cell.speed_mps * path.half_s
            apart_m.append(float(level_m.min()) - 1e3 * cell.radius_km - moves_m - farthest_m)
    return apart_m


def weather_cells_on_sight_lines(block: Any, cells: Cells) -> Iterator[tuple[WeatherCell, Within]]:
    """Yield each weather cell and where lines of sight enter and leave it, as length shares."""
    place = [cells.field_at_rows(f"own_{name}") for name in ("lat_deg", "lon_deg", "alt_m")]
    line = cells.azimuth_rad, cells.elevation_rad, cells.range_m
    time_s = cells.state_ns / NANOSECONDS
    for one in weather_cells(block):
        yield one, one.entry_and_exit_shares(place, line, time_s)


def entry_and_exit_heights_m(cells: Cells, within: Within) -> tuple[FloatArray, FloatArray]:
    """Return the heights (m) at which each line of sight enters and leaves a weather cell."""
    own_m = cells.field_at_rows("own_alt_m")
    climb_m = cells.alt_m - own_m
    return own_m + within.enters * climb_m, own_m + within.leaves * climb_m
