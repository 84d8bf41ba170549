#include "abbe/calib/mfb/solve/solve.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/mfb/solve/simultaneous.hpp"
#include "abbe/result/try.hpp"
#include "observe/bar_temperature.hpp"
#include "solve/sequential.hpp"

namespace abbe::calib::mfb {
namespace {

/// Texts such as "ECX (u up to 1800 urad)" for each error whose uncertainty exceeds the limits.
std::vector<std::string> errors_not_shown(const Observations& o, const Eigen::VectorXd& variance,
                                          const SolveOptions& options) {
  std::vector<std::string> found;
  const auto add = [&](const std::string& error, bool angle, Eigen::Index first,
                       Eigen::Index count) {
    const double u = std::sqrt(std::max(0.0, variance.segment(first, count).maxCoeff()));
    if (!(u <= (angle ? options.most_u_rad : options.most_u_m))) {
      found.push_back(message(error, " (u up to ", u * kUmPerM, angle ? " urad" : " um", ")"));
    }
  };

  const ParameterLayout& layout = o.basis.layout();
  for (const Table& table : layout.tables()) {
    add(calib::name(table.motion), is_rotation(table.motion.motion),
        static_cast<Eigen::Index>(table.offset),
        static_cast<Eigen::Index>(layout.node_count(table.motion.axis)));
  }
  auto parameter = static_cast<Eigen::Index>(layout.squareness_offset());
  for (const std::string_view squareness : kSquarenessNames) {
    add(std::string(squareness), true, parameter++, 1);
  }
  return found;
}

}  // namespace

std::string_view name(Estimator estimator) {
  return estimator == Estimator::Simultaneous ? "simultaneous" : "sequential";
}

std::optional<Estimator> estimator_named(std::string_view text) {
  for (const Estimator estimator : {Estimator::Simultaneous, Estimator::Sequential}) {
    if (text == name(estimator)) {
      return estimator;
    }
  }
  return std::nullopt;
}

Result<void> check_shown(const Observations& o, const Solution& solution,
                         const SolveOptions& options) {
  const std::vector<std::string> not_shown =
      errors_not_shown(o, solution.covariance.diagonal(), options);
  if (not_shown.empty()) {
    return {};
  }
  std::string list;
  for (const std::string& error : not_shown) {
    list += (list.empty() ? "" : ", ") + error;
  }
  // Far from 20 C the uncertainty of the expansion causes a large uncertainty of the scales.
  const std::optional<std::string> far = bar_far_from_reference(o);
  return failure(
      ErrorCode::RankDeficient,
      message("identification: the positions of the bar do not show ", list, "; at most ",
              options.most_u_m * kUmPerM, " um and ", options.most_u_rad * kUmPerM, " urad: ",
              far ? message(*far,
                            "; check temperature_C, in degrees Celsius, or measure in "
                            "further positions")
                  : "measure in further positions"));
}

Result<Solution> solve(const Observations& o, const SolveOptions& options) {
  Result<Solution> solution = options.estimator == Estimator::Simultaneous
                                  ? solve_simultaneously(o, nuisance_options(options))
                                  : solve_sequential(o, options);
  if (!solution) {
    return solution;
  }
  ABBE_TRY(check_shown(o, *solution, options));
  return solution;
}

}  // namespace abbe::calib::mfb
