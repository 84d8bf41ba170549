#pragma once
/// Finds visits of reference nests in the stream of the tracker. A visit consists of consecutive
/// valid samples within the radius of a nest, with pauses of at most 2 s. In at least half of them,
/// and for at least 0.5 s, the target must stand still: within 50 um, or six standard deviations of
/// a sample, of their median.
///
/// Other samples within the radius are not a visit: they belong to a target that moves past.
/// Samples that follow the sample before them, or are followed by the next sample, without a gap of
/// more than four sample periods also belong to the machine's target, which stands at a vertex near
/// the nest. All samples within 1 mm of such a place are excluded, too.

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
  std::size_t samples = 0;  ///< number of samples in the mean
};

struct NestVisits {
  std::vector<NestVisit> found;        ///< in the order of time
  std::vector<std::string> names{};    ///< names of the nests
  std::vector<std::size_t> samples{};  ///< indices of all samples that belong to visits
  std::vector<std::string> notes{};    ///< notes for the verdict: nests that were never or too
                                       ///< shortly seen, or near which the machine stood
};

/// Index of the nest whose radius contains the point; nullopt: none.
[[nodiscard]] std::optional<std::size_t> nest_at(const Vector3& p_tracker_m,
                                                 const std::vector<Nest>&);

/// Finds the visits; without nests there are none. BadInput for a nest without a name, two nests
/// with the same name, a radius or repeatability that is not positive, or two nests whose radii
/// overlap. Times and positions of the samples must be finite.
[[nodiscard]] Result<NestVisits> find_nest_visits(std::span<const TrackerObservation>,
                                                  const NestOptions&, const Noise&);

}  // namespace abbe::calib::otf
