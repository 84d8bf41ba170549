#include "abbe/calib/internal/mfb/identify/reversal.hpp"

#include <cmath>
#include <string_view>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::mfb {
namespace {

Result<void> check_passes(const std::vector<BarPass>& passes, std::size_t holes,
                          std::string_view which) {
  for (std::size_t k = 0; k < passes.size(); ++k) {
    if (passes[k].size() != holes) {
      return failure(ErrorCode::BadInput,
                     message("reversal: ", which, " pass ", k + 1, " has ", passes[k].size(),
                             " points, E_XX of the machine is given for ", holes));
    }
    for (std::size_t i = 0; i < holes; ++i) {
      if (!passes[k][i].allFinite()) {
        return failure(ErrorCode::NotFinite, message("reversal: ", which, " pass ", k + 1,
                                                     ", hole ", i + 1, " is not a number"));
      }
    }
  }
  return {};
}

Result<void> check(const ReversalRuns& runs) {
  constexpr std::size_t kFewestRepeats = 2;
  constexpr std::size_t kFewestHolesOfPass = 2;
  const std::size_t holes = runs.machine_x_m.size();
  if (holes < kFewestHolesOfPass) {
    return failure(ErrorCode::BadInput,
                   message("reversal: E_XX of the machine is given for ", holes,
                           " holes, needs at least ", kFewestHolesOfPass));
  }
  if (runs.normal.size() != runs.reversed.size()) {
    return failure(ErrorCode::BadInput,
                   message("reversal: ", runs.normal.size(), " normal passes, but ",
                           runs.reversed.size(), " reversed ones"));
  }
  if (runs.normal.size() < kFewestRepeats) {
    return failure(ErrorCode::TooFewObservations,
                   message("reversal: ", runs.normal.size(), " repeats, needs at least ",
                           kFewestRepeats, " to state an uncertainty"));
  }
  if (!runs.u_machine_x_m.empty() && runs.u_machine_x_m.size() != holes) {
    return failure(ErrorCode::BadInput, message("reversal: ", runs.u_machine_x_m.size(),
                                                " uncertainties for E_XX at ", holes, " holes"));
  }
  for (std::size_t i = 0; i < holes; ++i) {
    const double u_m = runs.u_machine_x_m.empty() ? 0.0 : runs.u_machine_x_m[i];
    const bool finite = std::isfinite(runs.machine_x_m[i]) && std::isfinite(u_m);
    if (!finite || u_m < 0.0) {
      return failure(finite ? ErrorCode::BadInput : ErrorCode::NotFinite,
                     message("reversal: E_XX at hole ", i + 1, " is ", runs.machine_x_m[i],
                             " m with u ", u_m, " m: must be finite, u not negative"));
    }
  }
  return check_passes(runs.normal, holes, "normal").and_then([&] {
    return check_passes(runs.reversed, holes, "reversed");
  });
}

/// Error of the bar and error of the machine (x: without E_XX) from one normal and one reversed
/// pass.
struct PairOfPasses {
  Vector3 bar_m, machine_m;

  PairOfPasses(const Vector3& normal_m, const Vector3& reversed_m)
      : bar_m(0.5 * (normal_m - reversed_m)), machine_m(-0.5 * (normal_m + reversed_m)) {
    bar_m.x() = -machine_m.x();
    machine_m.x() = 0.0;
  }
};

}  // namespace

Result<CalibratedBar> calibrate_by_reversal(const ReversalRuns& runs) {
  ABBE_TRY(check(runs));

  const auto repeats = static_cast<double>(runs.normal.size());
  CalibratedBar bar;
  bar.degrees_of_freedom = runs.normal.size() - 1;
  for (std::size_t i = 0; i < runs.machine_x_m.size(); ++i) {
    Vector3 mean = Vector3::Zero(), of_machine = Vector3::Zero(), squares = Vector3::Zero();
    for (std::size_t k = 0; k < runs.normal.size(); ++k) {
      const PairOfPasses pair(runs.normal[k][i], runs.reversed[k][i]);
      mean += pair.bar_m / repeats;
      of_machine += pair.machine_m / repeats;
    }
    for (std::size_t k = 0; k < runs.normal.size(); ++k) {
      squares += (PairOfPasses(runs.normal[k][i], runs.reversed[k][i]).bar_m - mean).cwiseAbs2();
    }

    Vector3 variance = squares / (repeats * (repeats - 1.0));
    bar.u_mean_m.emplace_back(variance.cwiseSqrt());
    const double u_x_m = runs.u_machine_x_m.empty() ? 0.0 : runs.u_machine_x_m[i];
    variance.x() += u_x_m * u_x_m;
    const Vector3 positioning(runs.machine_x_m[i], 0.0, 0.0);
    bar.error_m.emplace_back(mean + positioning);
    bar.machine_m.emplace_back(of_machine + positioning);
    bar.u_m.emplace_back(variance.cwiseSqrt());
  }
  return bar;
}

}  // namespace abbe::calib::mfb
