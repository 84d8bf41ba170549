#pragma once
/// Visits of reference nests in the stream of the tracker. Valid samples that follow one another
/// within the radius of a nest, with pauses of at most 2 s, are a visit if the target stands in at
/// least half of them for at least 0.5 s: within 50 um, or six standard deviations of a sample, of
/// their median. Other samples within the radius belong to a target that passes. So do those that
/// follow on the sample before them, or are followed by the one behind them, without a gap of more
/// than four sample periods, and all samples within 1 mm of such a place: the target of the machine
/// that stands at a vertex near the nest.

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/base/error.hpp"
#include "abbe/calib/otf/run/run.hpp"

namespace abbe::calib::otf {

struct NestVisit {
  std::size_t nest = 0;  ///< index in NestOptions::nests
  double time_s = 0.0;   ///< mean of its samples, tracker clock
  Vector3 mean_tracker_m = Vector3::Zero();
  /// Covariance of the mean from the noise of the samples: stated for the tracker, or larger if
  /// their scatter or the scatter of means over eighths of the visit is larger.
  Matrix3 cov_tracker_m2 = Matrix3::Zero();
  std::size_t samples = 0;  ///< in the mean
};

struct NestVisits {
  std::vector<NestVisit> found;        ///< in the order of time
  std::vector<std::string> names{};    ///< of the nests
  std::vector<std::size_t> samples{};  ///< indices of all samples that belong to visits
  std::vector<std::string> notes{};    ///< for the verdict: nests never or too shortly seen, or
                                       ///< near which the machine stood
};

/// Index of the nest within whose radius a point is.
[[nodiscard]] std::optional<std::size_t> nest_at(const Vector3& p_tracker_m,
                                                 const std::vector<Nest>&);

/// No visits without nests. BadInput for a nest without a name, two of the same name, a radius or
/// repeatability that is not positive, or two nests whose radii overlap. Times and positions of the
/// samples must be numbers.
[[nodiscard]] Result<NestVisits> find_nest_visits(std::span<const TrackerObservation>,
                                                  const NestOptions&, const Noise&);

}  // namespace abbe::calib::otf
