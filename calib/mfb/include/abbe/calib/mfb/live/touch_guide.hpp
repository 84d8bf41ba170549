#pragma once
/// Tells which touch of a Multi-Feature Bar comes next, assigns each touch to its place on the bar,
/// and finds touches that are missing, repeated or wrong. Measurement by measurement of the plan; a
/// forward pass goes along the bar feature by feature (probing_order()), a backward pass the other
/// way. Only the coordinates of the touches are used, no time and no command of the operator.
///
/// The bar is clamped by hand beside its planned pose. The first touch of a pass must be the
/// planned one; it gives the shift, and every further touch improves the pose, which tells the
/// place of the next ones:
///     tip = planned tip + s + w x (planned tip - O_1) + noise,   s: shift, w: rotation, both with a
///     normal prior; noise 0.2 mm along the normal of the surface, 1 mm along the surface
/// So a programme and a touch by hand, up to 3 mm beside the planned point, are both assigned.
///
/// At the end of a pass its features, the way the bar lies and the calibrated places are checked
/// (observe()). A pass that fails is discarded and asked for again; the passes before are kept.
/// Lengths in m, machine axes. Allocates, so not for a real-time thread; not thread-safe.

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "abbe/calib/mfb/observe/observe.hpp"

namespace abbe::calib::mfb {

struct GuideOptions {
  ObserveLimits limits{};
  /// Two touches nearer than this are the same touch made twice.
  double same_place_m = 50e-6;
  /// Largest distance of a touch from its expected place.
  double off_place_m = 3e-3;
  /// Number of successive touches at no expected place after which the guide fails.
  std::size_t most_off_place = 20;
};

struct NextTouch {
  std::size_t measurement = 0;  ///< index in the plan
  Target target;
  std::size_t touched = 0;  ///< touches taken on this feature
  std::size_t planned = 0;  ///< touches planned on this feature
};

/// How a touch was used. Only Taken touches enter the result. SamePlace: made twice; Doubled:
/// another touch at a place that has its touch; NotOnBar: at no expected place, not a number, or
/// after the guide is complete or has failed.
enum class TouchFate { Taken, SamePlace, Doubled, NotOnBar };

struct GuidedTouch {
  TouchFate fate = TouchFate::Taken;
  std::vector<std::string> notes;  ///< one sentence each; empty: the touch was as expected
};

class TouchGuide {
 public:
  /// Errors of check() for bar and plan, and of planned_observations().
  [[nodiscard]] static Result<TouchGuide> create(Bar, Plan, MfbMachine, GuideOptions = {});
  TouchGuide(TouchGuide&&) noexcept;
  TouchGuide& operator=(TouchGuide&&) noexcept;
  ~TouchGuide();

  /// `reading_m`: scale readings of X, Y, Z. To continue an interrupted session, give its readings
  /// again in their order. Once complete() or after a failure(), no touch is taken.
  [[nodiscard]] GuidedTouch take(const Vector3& reading_m);

  [[nodiscard]] bool complete() const;
  /// Why the calibration is impossible: another bar, or touches that do not follow the plan.
  [[nodiscard]] const std::optional<Error>& failure() const;
  /// Only before complete().
  [[nodiscard]] NextTouch next() const;
  /// "X3: hole 4, k = 2, 2 of 8 touches made".
  [[nodiscard]] std::string next_text() const;
  [[nodiscard]] std::size_t taken() const;
  [[nodiscard]] std::size_t planned() const;
  /// One per measurement of the plan, in the order of probing; those to come are empty.
  [[nodiscard]] const std::vector<PassTouches>& passes() const;
  [[nodiscard]] const Plan& plan() const;

 private:
  class Session;
  explicit TouchGuide(std::unique_ptr<Session>);
  std::unique_ptr<Session> session_;
};

}  // namespace abbe::calib::mfb
