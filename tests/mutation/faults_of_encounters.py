"""Faults of encounters: models sampled wrongly, weights that undo something else, wrong ratios."""

from fault import in_file

_GROUP = "encounters"
_SAMPLING = "encounters/test_sampling.py"
_PAIRING = "encounters/test_pairing.py"
_RISK = "encounters/test_risk.py"

FAULTS = [
    *in_file(
        _GROUP, "components/encounters/sampling.py", _SAMPLING,
        ("parents-of-time-0", "now[step.before] = now[step.place]", "pass"),
        ("bin-1-where-nothing-was-counted", "np.where(empty, 0.0, np.where(chance",
         "np.where(empty, 2.0, np.where(chance"),
        ("new-value-from-the-whole-draw", "(left[anew] / self._rate)", "left[anew]"),
    ),
    *in_file(
        _GROUP, "components/encounters/bayes_network.py", _SAMPLING,
        ("last-parent-fastest", "for parent in parents:", "for parent in reversed(parents):"),
    ),
    *in_file(
        _GROUP, "components/encounters/model.py", _SAMPLING,
        ("bin-around-zero-uniform", "np.where(self._around_zero, 0.0, np.diff(self.edges))",
         "np.diff(self.edges)"),
    ),
    *in_file(
        _GROUP, "components/encounters/pair_densities.py", _PAIRING,
        ("modulus-for-parameter", "ellipe(4.0 * first * second / largest)",
         "ellipe(np.sqrt(4.0 * first * second / largest))"),
    ),
    *in_file(
        _GROUP, "components/encounters/pairing.py", _PAIRING,
        ("weight-without-the-vertical-chance", "/ q / chance", "/ q"),
        ("miss-on-the-other-side", "(horizontal * east / relative, -horizontal * north / relative)",
         "(-horizontal * east / relative, horizontal * north / relative)"),
        ("range-of-the-start-as-height", "< rules.start_vertical_ft)", "< rules.start_range_ft)"),
    ),
    *in_file(
        _GROUP, "dsa_des/studies/ratio.py", _RISK,
        ("denominator-taken-as-known", "residual = y - ratio * x",
         "residual = y - above / total * each"),
        ("ratio-without-weights", "ratio = above / below", "ratio = math.fsum(m) / math.fsum(n)"),
    ),
]  # fmt: skip
