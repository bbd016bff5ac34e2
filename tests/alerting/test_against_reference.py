"""Alert levels and times against recorded output of the reference logic, row by row."""

import numpy as np
import pytest

from components.alert_configuration.conf_file import read_conf
from components.alerting.alert_tables import alert_table_csv, remove_hysteresis
from components.alerting.encounter import read_encounter
from components.alerting.levels import alert_levels
from components.arguments.units import FOOT_M
from components.well_clear.tcas import tcas_advisory_span
from tests.alerting.reference_data import reference_file, reference_text, rows

TIMES = slice(5, 8)
STATES = [
    ("random_states", "do365b.conf", "random_states.xyz.gz"),
    ("random_states_mixed", "mixed_volumes.conf", "random_states.xyz.gz"),
    ("sum_states", "do365b_sum.conf", "sum_states.xyz.gz"),
]


def differences(configuration, path, wanted, decimals):
    """Return heads, and per column the largest difference; blanks and names must be the same."""
    encounter = read_encounter(path, configuration)
    found = alert_levels(
        configuration,
        encounter.time_s,
        encounter.present,
        encounter.pairs,
        encounter.alerter,
    )
    table = alert_table_csv(configuration, encounter, found, decimals)
    assert table.splitlines()[:2] == wanted.splitlines()[:2]
    got, want = rows(table)[2:], rows(wanted)[2:]
    assert [row[:5] for row in got] == [row[:5] for row in want]
    worst = np.zeros(len(got[0]))
    for one, other in zip(got, want, strict=True):
        for place, (a, b) in enumerate(zip(one[5:], other[5:], strict=True), start=5):
            if a in ("", "infty") or b in ("", "infty"):
                assert a == b, (place, one, other)
            else:
                worst[place] = max(worst[place], abs(float(a) - float(b)))
    return worst


@pytest.mark.parametrize("flight", [3, 23, 51])
@pytest.mark.parametrize("memory", [True, False])
def test_flown_encounters(flight, memory):
    configuration = read_conf(reference_file("alerting/do365b.conf"))
    path = reference_file(f"nrc_intercepts/NRC_Intercept{flight}.daa")
    name = f"alerting/NRC_Intercept{flight}{'' if memory else '_nohysteresis'}.csv.gz"
    used = configuration if memory else remove_hysteresis(configuration)
    worst = differences(used, path, reference_text(name), 9)
    assert worst[TIMES].max() < 1e-8
    assert worst[[8, 9, 10, 11, 12, 13, 15]].max() < 1e-8  # separations


@pytest.mark.parametrize(("name", "conf", "states"), STATES)
def test_random_states(name, conf, states, tmp_path):
    configuration = remove_hysteresis(read_conf(reference_file(f"alerting/{conf}")))
    path = tmp_path / "states.xyz"
    path.write_text(reference_text(f"alerting/{states}"), encoding="utf-8")
    worst = differences(configuration, path, reference_text(f"alerting/{name}.csv.gz"), 12)
    assert worst.max() < 1e-9


@pytest.mark.parametrize("resolution", [False, True])
def test_tcas_advisories(resolution, tmp_path):
    wanted = rows(reference_text("alerting/random_states_tcas.csv.gz"))[2:]
    path = tmp_path / "states.xyz"
    path.write_text(reference_text("alerting/random_states.xyz.gz"), encoding="utf-8")
    encounter = read_encounter(path, read_conf(reference_file("alerting/do365b.conf")))
    lines = rows(path.read_text(encoding="utf-8"))[2::2]
    altitude_m, climb_mps = (np.array([float(r[i]) for r in lines]) * FOOT_M for i in (3, 6))
    relative = tuple(part[:, 0] for part in encounter.relative)
    found = tcas_advisory_span(
        relative, altitude_m, climb_mps / 60.0, resolution=resolution, end_s=60.0
    )
    want = np.array([float(row[5 + resolution].replace("infty", "inf")) for row in wanted])
    assert (np.isinf(want) == np.isinf(found.begin_s)).all()
    met = np.isfinite(want)
    assert met.sum() > 70
    assert np.abs(want[met] - found.begin_s[met]).max() < 1e-9
