"""What the tracker guarantees: one small pure function for each statement.

`window` holds Theorem 1 and its exact form (fixed step, feedback delay), `horizon` what that means
over time, `trouble` what feedback that is lost or wrong costs, `varying` the variable step, `safe`
the eventually safe policy with unbounded scores, `integral` the saturated integrator. All take
`alpha` (always miscoverage), `eta`, `B` and `W` as in the paper. Arguments are read as exact
numbers (see `cpl.conformal.rational`): counts of misses are exact integers; rates are fractions if
all inputs are, else floats rounded once.
"""

from cpl.conformal.bounds.horizon import (
    error_rate_bound_with_resets,
    interleaved_deviation_bound,
    latch_ratio,
    longest_miss_run,
    smallest_informative_window,
    smallest_two_sided_window,
    unscored_predictions,
    window_table,
)
from cpl.conformal.bounds.integral import pi_envelope, pi_error_range, pi_turning_point
from cpl.conformal.bounds.safe import (
    eventually_safe_deviation_bound,
    eventually_safe_overshoot,
    eventually_safe_range,
    eventually_safe_range_sharp,
)
from cpl.conformal.bounds.trouble import (
    max_errors_in_trouble,
    min_errors_in_trouble,
    troubled_range,
)
from cpl.conformal.bounds.varying import (
    decreasing_step_bound,
    increasing_step_bound,
    inverse_step_variation,
    running_maximum_bound,
    variable_step_bound,
)
from cpl.conformal.bounds.window import (
    QuantileRange,
    attained_for_certain,
    deviation_bound,
    error_rate_bound,
    max_errors,
    max_errors_from_start,
    min_errors,
    min_errors_from_start,
    quantile_range,
    quantile_range_as_printed,
    window_errors,
    window_errors_as_printed,
)

__all__ = [
    "QuantileRange",
    "attained_for_certain",
    "decreasing_step_bound",
    "deviation_bound",
    "error_rate_bound",
    "error_rate_bound_with_resets",
    "eventually_safe_deviation_bound",
    "eventually_safe_overshoot",
    "eventually_safe_range",
    "eventually_safe_range_sharp",
    "increasing_step_bound",
    "interleaved_deviation_bound",
    "inverse_step_variation",
    "latch_ratio",
    "longest_miss_run",
    "max_errors",
    "max_errors_from_start",
    "max_errors_in_trouble",
    "min_errors",
    "min_errors_from_start",
    "min_errors_in_trouble",
    "pi_envelope",
    "pi_error_range",
    "pi_turning_point",
    "quantile_range",
    "quantile_range_as_printed",
    "running_maximum_bound",
    "smallest_informative_window",
    "smallest_two_sided_window",
    "troubled_range",
    "unscored_predictions",
    "variable_step_bound",
    "window_errors",
    "window_errors_as_printed",
    "window_table",
]
