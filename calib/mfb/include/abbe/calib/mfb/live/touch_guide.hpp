#pragma once
/// Determines which touch of a Multi-Feature Bar comes next, assigns each touch to its place on the
/// bar, and finds touches that are missing, repeated or wrong. The measurements follow the order of
/// the plan. A forward pass goes along the bar feature by feature (probing_order()), a backward
/// pass in the opposite order. Only the coordinates of the touches are used, no time and no command
/// of the operator.
///
/// The bar is clamped by hand near its planned pose. The first touch of a pass must be the planned
/// one and gives the shift. Every further touch improves the pose, from which the places of the
/// next touches are predicted:
///     tip = planned tip + s + w x (planned tip - O_1) + noise,   s: shift, w: rotation, both with a
///     normal prior; noise 0.2 mm along the normal of the surface, 1 mm along the surface
/// Touches by a program and touches by hand, up to 3 mm beside the planned point, can thus be
/// assigned.
///
/// At the end of a pass observe() checks its features, the orientation of the bar and the
/// calibrated places. A pass that fails is discarded and requested again; earlier passes are kept.
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

/// How a touch was used. Only Taken touches enter the result. SamePlace: the same touch made twice;
/// Doubled: a further touch at a place that already has its touch; NotOnBar: the touch is at no
/// expected place, is not a number, or was made after the guide was complete or failed.
enum class TouchFate { Taken, SamePlace, Doubled, NotOnBar };

struct GuidedTouch {
  TouchFate fate = TouchFate::Taken;
  std::vector<std::string> notes;  ///< one sentence each; empty: the touch was as expected
};

class TouchGuide {
 public:
  /// Creates a guide. Errors of check() for bar and plan, and of planned_observations().
  [[nodiscard]] static Result<TouchGuide> create(Bar, Plan, MfbMachine, GuideOptions = {});
  TouchGuide(TouchGuide&&) noexcept;
  TouchGuide& operator=(TouchGuide&&) noexcept;
  ~TouchGuide();

  /// Assigns a touch. `reading_m`: scale readings of X, Y, Z. To continue an interrupted session,
  /// pass its readings again in the same order. Once complete() or after a failure(), no touch is
  /// taken.
  [[nodiscard]] GuidedTouch take(const Vector3& reading_m);

  [[nodiscard]] bool complete() const;
  /// The reason why the calibration cannot continue: another bar, or touches that do not follow the
  /// plan.
  [[nodiscard]] const std::optional<Error>& failure() const;
  /// The touch that is expected next. Must not be called once complete().
  [[nodiscard]] NextTouch next() const;
  /// Text such as "X3: hole 4, k = 2, 2 of 8 touches made".
  [[nodiscard]] std::string next_text() const;
  [[nodiscard]] std::size_t taken() const;
  [[nodiscard]] std::size_t planned() const;
  /// One entry per measurement of the plan, with its touches in the order of probing; future
  /// measurements are empty.
  [[nodiscard]] const std::vector<PassTouches>& passes() const;
  [[nodiscard]] const Plan& plan() const;

 private:
  class Session;
  explicit TouchGuide(std::unique_ptr<Session>);
  std::unique_ptr<Session> session_;
};

}  // namespace abbe::calib::mfb
