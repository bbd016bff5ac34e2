"""Does a table of areas count its azimuth from the wing instead of the nose?"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from components.aircraft.aspect_tables import SilhouetteTable

# Light aircraft show up to a fifth more from the nose than abeam, or less: only what is clearly the
# other way round than the model is spoken of.
_CLEARLY = 1.25


def turned_table_warning(areas: Mapping[str, float], table: SilhouetteTable) -> str | None:
    """Say that a table looks turned by 90°, or return None.

    A fuselage shows more abeam than from the nose. Where the three bodies say so by more than a
    quarter and the table says the opposite by as much, its azimuths most likely count from a wing.

    Parameters
    ----------
    areas : mapping
        front_m2 and side_m2 of the model.
    table : SilhouetteTable

    Returns
    -------
    str or None
    """
    from_nose = float(np.mean(table.area(np.radians([0.0, 180.0]), 0.0)))
    abeam = float(np.mean(table.area(np.radians([90.0, 270.0]), 0.0)))
    model_nose, model_abeam = areas["front_m2"], areas["front_m2"] + areas["side_m2"]
    longer = model_abeam > _CLEARLY * model_nose and from_nose > _CLEARLY * abeam
    if not longer:
        return None
    return (
        f"the table looks turned by 90 degrees: along az_deg 0 and 180 it shows {from_nose:.1f} "
        f"m², along 90 and 270 only {abeam:.1f}, where the model shows {model_nose:.1f} from the "
        f"nose and {model_abeam:.1f} abeam; az_deg 0 must be the nose, 90 the right wing"
    )
