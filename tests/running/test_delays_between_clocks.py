"""A delay in scans counts those of the receiver, also where the sender has a clock of its own."""

import pytest


@pytest.mark.parametrize("sampler", ["Sampler", "Queuer"])
def test_a_delay_in_scans_is_of_the_receiver_where_both_have_clocks(lab, sampler):
    """A pulse at 10 Hz, read at 4 Hz: one scan of the reader is 0.25 s."""
    path = lab.write(
        {"pulse": "Pulse; scan_rate_hz = 10", "reader": f"{sampler}; scan_rate_hz = 4"},
        ['{from = "pulse", to = "reader", delay = "1 scan"}'],
        duration_s=2,
    )
    tables = lab.run(path).tables
    sent = [(row["time_s"], row["value"]) for row in lab.rows(tables, "pulse")]
    read = {row["time_s"]: row["value"] for row in lab.rows(tables, "reader")}
    for scan in range(2, 8):
        time_s = 0.25 * scan
        there = [value for sent_s, value in sent if sent_s + 0.25 <= time_s + 1e-9]
        before = [value for sent_s, value in sent if sent_s + 0.25 <= time_s - 0.25 + 1e-9]
        expected = there[-1] if sampler == "Sampler" else sum(there[len(before) :])
        assert read[time_s] == pytest.approx(expected)
