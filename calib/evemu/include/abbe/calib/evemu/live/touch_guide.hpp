#pragma once
/// Determines which ball or block of the array is being touched, what is to be touched next, and
/// which touches are wrong. [Li OMM] section 3: at every position Ball1, Block1, Block2, then Ball2
/// to the last; the artefact is turned about Ball1 between positions. Only the coordinates of the
/// touches are used, no time and no operator command: the guide assigns a touch to the feature that
/// it expects at this place. Ball1 stays in place. Ball1 and the two faces determine the place of
/// every other ball (on which side of the faces the balls lie follows from the first completed
/// balls and is known at later positions). A missed, repeated or wrong touch is therefore detected
/// and reported, the touches acquired before are kept, and missing points are requested again.
/// Lengths in m, machine coordinates. Allocates, so not for a real-time thread; not thread-safe.

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/evemu/observe/observe.hpp"

namespace abbe::calib::evemu {

struct TouchPlan {
  std::vector<int> positions{4, 8, 3, 7,
                             2, 6, 1, 5};  ///< position numbers 1 .. n in the order in which they
                                           ///< are touched
  std::size_t points_per_ball = 25;
  std::size_t points_per_block = 25;
};

struct GuideOptions {
  ObserveOptions observe{};  ///< fewest points, tolerances; `positions` comes from the plan
  /// Two touches nearer than this are the same place touched twice. The repeatability of a touch is
  /// far below this distance, the distance between planned points far above.
  double same_place_m = 50e-6;
  /// Largest distance of a touch from the expected surface of its ball. The expected place differs
  /// from the true one by machine errors (up to 3 mm over the length of the array) and by errors of
  /// the measured faces.
  double max_off_expected_m = 5e-3;
  /// Number of successive touches on no known feature after which the guide fails.
  std::size_t most_off_feature = 20;
};

struct TouchedFeature {
  Feature feature = Feature::Ball;
  int number = 1;
  friend bool operator==(const TouchedFeature&, const TouchedFeature&) = default;
};
[[nodiscard]] std::string name(const TouchedFeature&);  ///< such as "ball 3", "block 1"

struct NextTouch {
  int position = 0;
  std::size_t place = 0;  ///< index of the position in the plan, from 0
  TouchedFeature on;
  std::size_t touched = 0;  ///< points taken on this feature
  std::size_t points = 0;   ///< points planned on this feature
};

/// A feature at the position that is being touched.
struct FeatureProgress {
  TouchedFeature on;
  std::size_t touched = 0;  ///< points taken
  std::size_t points = 0;   ///< points planned
  /// Place in machine coordinates: the centre of a ball, or the centroid of the points on a face.
  /// nullopt: the touches of this position do not determine it yet.
  std::optional<Vector3> at_m{};
  /// Normal of the face of a block, in machine coordinates, to the side that the calibrator states.
  /// nullopt: the touches do not determine this side yet.
  std::optional<Vector3> normal{};
};

/// How a touch was used. Only Taken touches enter the result. SamePlace: the place was touched
/// before; Doubled: the feature already has all its points; NotOnFeature: the touch is on no known
/// feature, or was ignored because the guide is complete or has failed, or because the feature
/// touched before was discarded.
enum class TouchFate { Taken, SamePlace, Doubled, NotOnFeature };
struct GuidedTouch {
  TouchFate fate = TouchFate::Taken;
  std::vector<std::string> notes;  ///< one sentence each; empty: the touch was as expected
};

class Site;

class TouchGuide {
 public:
  /// Creates a guide. Returns the errors of check(), and BadInput for an invalid plan.
  [[nodiscard]] static Result<TouchGuide> create(Calibrator, TouchPlan, GuideOptions = {});
  TouchGuide(TouchGuide&&) noexcept;
  TouchGuide& operator=(TouchGuide&&) noexcept;
  ~TouchGuide();

  /// Assigns a touch to a feature. `p_m`: centre of the tip at the touch. Once complete() or after
  /// a failure(), no touch is taken.
  [[nodiscard]] GuidedTouch take(const Vector3& p_m);

  [[nodiscard]] bool complete() const { return place_ == plan().positions.size(); }
  /// The reason why the calibration cannot continue: the calibrator describes another artefact, or
  /// the touches do not follow the plan. nullopt: no failure.
  [[nodiscard]] const std::optional<Error>& failure() const { return failure_; }
  /// The touch that is expected next. Must not be called once complete().
  [[nodiscard]] NextTouch next() const;
  /// The features at the current position in measuring order. Must not be called once complete().
  [[nodiscard]] std::vector<FeatureProgress> features() const;
  [[nodiscard]] std::size_t taken() const;
  [[nodiscard]] std::size_t planned() const;
  /// Taken touches of the finished positions and of the current one.
  [[nodiscard]] std::vector<Touch> touches() const;
  [[nodiscard]] const TouchPlan& plan() const;

 private:
  struct Setup;
  explicit TouchGuide(std::unique_ptr<const Setup> setup);

  [[nodiscard]] std::size_t points_of(std::size_t feature) const;
  [[nodiscard]] std::size_t least_of(std::size_t feature) const;
  [[nodiscard]] bool has_enough(std::size_t feature) const;
  [[nodiscard]] bool all_have_enough() const;
  [[nodiscard]] std::string where() const;
  [[nodiscard]] std::string tally(std::size_t feature) const;
  void begin_position();
  void astray(const Vector3& p_m, GuidedTouch& out);
  void on_complete_feature(std::size_t feature, const Vector3& p_m, GuidedTouch& out);
  void put(std::size_t feature, const Vector3& p_m, GuidedTouch& out);
  [[nodiscard]] bool skip_to(std::size_t feature, GuidedTouch& out);
  [[nodiscard]] bool accept_feature(std::size_t feature, GuidedTouch& out);
  void accept_ball(std::size_t feature, GuidedTouch& out);
  void expect_next_after(std::size_t feature, GuidedTouch& out);
  void end_position(GuidedTouch& out);
  void discard_feature(std::size_t feature, const std::string& why, GuidedTouch& out);
  void discard_position(const std::string& why, GuidedTouch& out);
  void fail(ErrorCode code, std::string text);

  std::unique_ptr<const Setup> setup_;  // its address does not change when the guide is moved
  std::unique_ptr<Site> site_;
  std::size_t place_ = 0;
  std::size_t feature_ = 0;   ///< index of the expected feature, in measuring order
  std::vector<bool> passed_;  ///< by feature; true: later features were touched before this feature
                              ///< had all points
  std::vector<Touch> finished_;
  std::vector<Matrix3> seen_;  ///< orientations of the artefact at the finished positions
  std::size_t astray_in_a_row_ = 0;
  std::size_t discarded_in_a_row_ = 0;  ///< number of whole features or positions discarded in
                                        ///< succession
  std::optional<Error> failure_;
};

}  // namespace abbe::calib::evemu
