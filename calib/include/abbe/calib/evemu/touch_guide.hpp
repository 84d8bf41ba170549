#pragma once
/// Which ball or block of the array is being touched, what comes next, and what went wrong.
/// [Li OMM] section 3: at every position Ball1, Block1, Block2, then Ball2 to the last; the
/// artefact turns about Ball1 between positions. Only the places of the touches decide, no clock
/// and no command: a touch is told by where the features must be. Ball1 stands still; Ball1 and the
/// two faces give the place of every other ball (the side the faces look to follows from the first
/// balls finished, and is known at later positions). So a missed, doubled or wrong touch is
/// noticed, said, and costs nothing that was acquired: what is missing is asked for again. Lengths
/// in m, machine coordinates. Ordinary world; not thread-safe.

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/calib/evemu/observe.hpp"

namespace abbe::calib::evemu {

struct TouchPlan {
  std::vector<int> positions{4, 8, 3, 7,
                             2, 6, 1, 5};  ///< in the order they are touched; 1 .. n, each once
  std::size_t points_per_ball = 25;
  std::size_t points_per_block = 25;
};

struct GuideOptions {
  ObserveOptions observe{};  ///< fewest points, tolerances; `positions` comes from the plan
  /// Two touches nearer than this are one place touched twice: repeatability is far below, points
  /// far above.
  double same_place_m = 50e-6;
  /// Off the sphere a ball is expected at: errors near 3 mm over the length of the array, and the
  /// faces'.
  double max_off_expected_m = 5e-3;
  /// Touches on nothing known, one after the other, that end the guiding.
  std::size_t most_astray = 20;
};

struct TouchedFeature {
  Feature feature = Feature::Ball;
  int number = 1;
  friend bool operator==(const TouchedFeature&, const TouchedFeature&) = default;
};
[[nodiscard]] std::string name(const TouchedFeature&);  ///< "ball 3", "block 1"

struct NextTouch {
  int position = 0;
  std::size_t place = 0;  ///< of the position in the plan, from 0
  TouchedFeature on;
  std::size_t touched = 0;  ///< points it has
  std::size_t points = 0;   ///< points it is to have
};

/// What became of a touch. Only Taken ones enter the result.
enum class TouchFate { Taken, SamePlace, Doubled, Astray };
struct GuidedTouch {
  TouchFate fate = TouchFate::Taken;
  std::vector<std::string> notes;  ///< one sentence each; none: as expected
};

class Site;

class TouchGuide {
 public:
  /// Error of check(), BadInput for a plan that is none.
  [[nodiscard]] static Result<TouchGuide> create(Calibrator, TouchPlan, GuideOptions = {});
  TouchGuide(TouchGuide&&) noexcept;
  TouchGuide& operator=(TouchGuide&&) noexcept;
  ~TouchGuide();

  /// The tip's centre at a touch. Once complete() or failed(), nothing is taken any more.
  [[nodiscard]] GuidedTouch take(const Vector3& p_m);

  [[nodiscard]] bool complete() const { return place_ == plan().positions.size(); }
  /// Why no calibration can come of it: the calibrator is another artefact's, or nobody follows.
  [[nodiscard]] const std::optional<Error>& failure() const { return failure_; }
  /// Not once complete().
  [[nodiscard]] NextTouch next() const;
  [[nodiscard]] std::size_t taken() const;
  [[nodiscard]] std::size_t planned() const;
  /// Of finished positions and the present one.
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
  [[nodiscard]] bool pass_over_until(std::size_t feature, GuidedTouch& out);
  [[nodiscard]] bool accept_feature(std::size_t feature, GuidedTouch& out);
  void accept_ball(std::size_t feature, GuidedTouch& out);
  void go_on_from(std::size_t feature, GuidedTouch& out);
  void end_position(GuidedTouch& out);
  void set_feature_aside(std::size_t feature, const std::string& why, GuidedTouch& out);
  void set_position_aside(const std::string& why, GuidedTouch& out);
  void fail(ErrorCode code, std::string text);

  std::unique_ptr<const Setup> setup_;  // stays where it is when the guide is moved
  std::unique_ptr<Site> site_;
  std::size_t place_ = 0;
  std::size_t feature_ = 0;   ///< expected, by measuring order
  std::vector<bool> passed_;  ///< somebody went on although points were missing
  std::vector<Touch> finished_;
  std::vector<Matrix3> seen_;  ///< directions of the finished positions
  std::size_t astray_in_a_row_ = 0;
  std::size_t set_aside_in_a_row_ = 0;  ///< whole features or positions
  std::optional<Error> failure_;
};

}  // namespace abbe::calib::evemu
