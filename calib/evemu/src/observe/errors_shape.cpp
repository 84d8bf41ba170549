#include "observe/errors_shape.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "abbe/calib/geometry/usual_mistakes.hpp"
#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"

namespace abbe::calib::evemu {
namespace {

/// Scatter over the positions of the distances between balls whose centres are at reading + L V.
/// The scatter is 0 if these are the true places of the balls of one artefact, also if V contains a
/// rotation.
double shape_scatter_m(const Observations& o, const Matrix3& L) {
  std::map<std::pair<int, int>, std::vector<double>> distances_m;
  for (std::size_t i = 0; i < o.rows.size(); ++i) {
    for (std::size_t j = i + 1; j < o.rows.size() && o.rows[j].position == o.rows[i].position;
         ++j) {
      const Vector3 a = o.rows[i].reading_m + L * o.rows[i].V_m,
                    b = o.rows[j].reading_m + L * o.rows[j].V_m;
      distances_m[{o.rows[i].ball, o.rows[j].ball}].push_back((b - a).norm());
    }
  }

  double squares = 0.0, free = 0.0;
  for (const auto& [balls, d] : distances_m) {
    const double mean = std::accumulate(d.begin(), d.end(), 0.0) / static_cast<double>(d.size());
    for (const double x : d) {
      squares += (x - mean) * (x - mean);
    }
    free += static_cast<double>(d.size()) - 1.0;
  }

  return free > 0.0 ? std::sqrt(squares / free) : 0.0;
}

/// Possible mistakes in the file of errors.
std::vector<AxisMistake> mistakes_of_errors() {
  std::vector<AxisMistake> all{
      {"all signs reversed (V = actual - nominal, in um)", -Matrix3::Identity()},
      {"errors in mm instead of um", 1e3 * Matrix3::Identity()},
      {"errors in mm instead of um and all signs reversed", -1e3 * Matrix3::Identity()}};
  // Wrong readings (true = f * given): they have the shape of given readings + V / f, enlarged by
  // f.
  for (const UnitMistake& mistake : unit_mistakes()) {
    all.push_back({mistake.text + " (readings)", Matrix3::Identity() / mistake.factor});
  }
  for (const AxisMistake& mistake : axis_mistakes()) {
    all.push_back({mistake.text + " in errors or readings", mistake.M});
  }
  return all;
}

}  // namespace

Result<void> check_one_shape(const Observations& o) {
  constexpr double kLeast_m = 1e-6;
  const double given_m = shape_scatter_m(o, Matrix3::Identity());
  // If errors do not fit the readings at all, every correction that makes them small fits better;
  // this is no mistake in the errors. The result must therefore be better than the readings without
  // errors. If the readings have one shape already (nominal places), no correction is found.
  const double without_m = shape_scatter_m(o, Matrix3::Zero());
  double best_m = kFarBetter * std::min(given_m, without_m);
  std::string text;

  for (const AxisMistake& mistake : mistakes_of_errors()) {
    if (const double scatter_m = shape_scatter_m(o, mistake.M); scatter_m < best_m) {
      best_m = scatter_m;
      text = mistake.text;
    }
  }

  if (given_m < kLeast_m || text.empty()) {
    return {};
  }

  return failure(
      ErrorCode::BadInput,
      message("errors: distances between the balls differ by ", kUmPerM * given_m,
              " um rms between the positions, but only by ", kUmPerM * best_m, " um with ", text));
}

}  // namespace abbe::calib::evemu
