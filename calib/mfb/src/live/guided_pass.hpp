#pragma once
/// One measurement of a session with a bar: its touches, and the places of those to come.

#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/mfb/live/touch_guide.hpp"
#include "observe/pose_of_touches.hpp"

namespace abbe::calib::mfb {

class GuidedPass {
 public:
  /// `nominal`: touches of the bar in the fixed order; it must outlive the pass. `pose`: of the bar
  /// in this position, if another measurement of it was touched.
  GuidedPass(const Measurement& m, const std::vector<NominalTouch>& nominal,
             const ObserveLimits& limits, const std::optional<PoseOfTouches>& pose);

  struct Nearest {
    std::size_t place = 0;  ///< in the fixed order
    double off_m = 0.0;     ///< from its expected place
  };
  [[nodiscard]] Nearest nearest(const Vector3& reading_m) const;
  /// Largest distance of the next touch from its expected place: the first touch of a position may
  /// be beside the plan as far as the bar.
  [[nodiscard]] double largest_off_m(double off_place_m) const;

  void put(std::size_t place, const Vector3& reading_m);
  /// Removes all touches.
  void clear();

  [[nodiscard]] bool has(std::size_t place) const { return has_[place]; }
  [[nodiscard]] bool is_same_place(std::size_t place, const Vector3& reading_m,
                                   double same_place_m) const;
  [[nodiscard]] bool complete() const { return touches_.size() == has_.size(); }
  /// Every feature has the touches that identification needs.
  [[nodiscard]] bool has_enough() const;
  /// The first place in the order of probing without a touch, from the last touch on; after the
  /// last place from the first on.
  [[nodiscard]] std::size_t next() const;
  /// Number of touches of the feature of a place, made and planned.
  [[nodiscard]] std::pair<std::size_t, std::size_t> count_of_feature(std::size_t place) const;
  /// Features before that of the last touch, in the order of probing, that lack touches; those that
  /// were named before are left out.
  [[nodiscard]] std::vector<std::string> newly_skipped();

  [[nodiscard]] const PassTouches& touches() const { return touches_; }
  [[nodiscard]] const std::optional<PoseOfTouches>& pose() const { return pose_; }
  [[nodiscard]] std::optional<std::size_t> last() const { return last_; }
  /// The place is of the feature with which the pass begins.
  [[nodiscard]] bool is_of_first_feature(std::size_t place) const;

 private:
  [[nodiscard]] Vector3 planned_m(std::size_t place) const;

  const Measurement& m_;
  const std::vector<NominalTouch>& nominal_;
  ObserveLimits limits_;
  std::vector<std::size_t> order_;  ///< places in the order of probing
  std::vector<std::size_t> rank_;   ///< of each place in the order
  std::optional<PoseOfTouches> first_pose_, pose_;
  std::vector<bool> has_, named_;   ///< by place; named_: as skipped
  std::vector<Vector3> reading_m_;  ///< by place
  PassTouches touches_;
  std::optional<std::size_t> last_;  ///< place of the last touch
};

}  // namespace abbe::calib::mfb
