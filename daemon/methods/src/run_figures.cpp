#include "abbe/methods/run_figures.hpp"

#include <cmath>

namespace abbe::daemon {

RunFigures run_figures(const calib::Verdict& verdict, std::string_view held_out) {
  // Without a held-out test the figures are not finite; model.json then contains 0.
  const auto or_none = [](double rms_m) { return std::isfinite(rms_m) ? rms_m : 0.0; };
  return {.held_out = std::string(held_out),
          .held_out_before_m = or_none(verdict.held_out.no_compensation_rms_m),
          .held_out_after_m = or_none(verdict.held_out.candidate_rms_m),
          .notes = verdict.notes,
          .residuals = {},
          .places_m = {}};
}

}  // namespace abbe::daemon
