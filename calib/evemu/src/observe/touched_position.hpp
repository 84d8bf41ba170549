#pragma once
/// Sorts the touches of a ball array by position, and fits the array at one position.

#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "abbe/calib/evemu/observe/observe.hpp"
#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib::evemu {

/// Touched points of one ball or block.
struct TouchedPoints {
  std::vector<Vector3> points_m;
  double index_sum = 0.0;  ///< sum of the points' indices among all touches

  void add(const Vector3& p_m, std::size_t index) {
    points_m.push_back(p_m);
    index_sum += static_cast<double>(index);
  }
  [[nodiscard]] double mean_index() const {
    return index_sum / static_cast<double>(points_m.size());
  }
};
/// Touched points of one position, by feature and number.
using Touched = std::map<std::pair<Feature, int>, TouchedPoints>;

[[nodiscard]] inline tl::unexpected<Error> at_position(int position, ErrorCode code,
                                                       const std::string& what) {
  return failure(code, message("position ", position, ": ", what));
}

/// Sorts the touches by position. TooFewObservations if a position of 1 to
/// ObserveOptions::positions has no touch; BadInput for another position number; NotFinite.
[[nodiscard]] Result<std::map<int, Touched>> by_position(std::span<const Touch>,
                                                         const ObserveOptions&);

/// Fits the spheres, planes and pose of a position. `at_machine`: the calibrator at the array's
/// temperature; `T_uni_pre`: transform from the coordinates of the calibrator to the uniform frame.
/// The text of BadInput names the feature that does not fit, and a mistake that would explain this.
[[nodiscard]] Result<TouchedArtefact> see(int position, const Touched&,
                                          const Calibrator& at_machine,
                                          const RigidTransform& T_uni_pre, const ObserveOptions&);

}  // namespace abbe::calib::evemu
