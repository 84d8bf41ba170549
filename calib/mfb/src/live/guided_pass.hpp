#pragma once
/// One measurement of a session with a bar: its touches so far, and the expected places of the next
/// ones.

#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/mfb/live/touch_guide.hpp"
#include "observe/pose_of_touches.hpp"

namespace abbe::calib::mfb {

class GuidedPass {
 public:
  /// `nominal`: touches of the bar in the fixed order; must outlive the pass. `pose`: pose of the
  /// bar, if another measurement of this position was touched before.
  GuidedPass(const Measurement& m, const std::vector<NominalTouch>& nominal,
             const ObserveLimits& limits, const std::optional<PoseOfTouches>& pose);

  struct Nearest {
    std::size_t place = 0;  ///< index in the fixed order
    double off_m = 0.0;     ///< distance from the expected place
  };
  [[nodiscard]] Nearest nearest(const Vector3& reading_m) const;
  /// Largest permitted distance of the next touch from its expected place. For the first touch of a
  /// position it is larger: the bar may be beside its planned pose.
  [[nodiscard]] double largest_off_m(double off_place_m) const;

  void put(std::size_t place, const Vector3& reading_m);
  /// Removes all touches.
  void clear();

  [[nodiscard]] bool has(std::size_t place) const { return has_[place]; }
  [[nodiscard]] bool is_same_place(std::size_t place, const Vector3& reading_m,
                                   double same_place_m) const;
  [[nodiscard]] bool complete() const { return touches_.size() == has_.size(); }
  /// True if every feature has the number of touches that identification needs.
  [[nodiscard]] bool has_enough() const;
  /// The next place without a touch in the order of probing. The search starts at the last touch
  /// and continues at the first place after the end.
  [[nodiscard]] std::size_t next() const;
  /// Number of touches of the feature of a place, made and planned.
  [[nodiscard]] std::pair<std::size_t, std::size_t> count_of_feature(std::size_t place) const;
  /// Features that lack touches and precede that of the last touch in the order of probing.
  /// Features that were returned before are left out.
  [[nodiscard]] std::vector<std::string> newly_skipped();

  [[nodiscard]] const PassTouches& touches() const { return touches_; }
  [[nodiscard]] const std::optional<PoseOfTouches>& pose() const { return pose_; }
  [[nodiscard]] std::optional<std::size_t> last() const { return last_; }
  /// True if the place belongs to the feature with which the pass begins.
  [[nodiscard]] bool is_of_first_feature(std::size_t place) const;

 private:
  [[nodiscard]] Vector3 planned_m(std::size_t place) const;

  const Measurement& m_;
  const std::vector<NominalTouch>& nominal_;
  ObserveLimits limits_;
  std::vector<std::size_t> order_;  ///< places in the order of probing
  std::vector<std::size_t> rank_;   ///< for each place: its index in order_
  std::optional<PoseOfTouches> first_pose_, pose_;
  std::vector<bool> has_, named_;   ///< by place; named_: returned by newly_skipped()
  std::vector<Vector3> reading_m_;  ///< by place
  PassTouches touches_;
  std::optional<std::size_t> last_;  ///< place of the last touch
};

}  // namespace abbe::calib::mfb
