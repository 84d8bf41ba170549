#pragma once
/// A TruthMachine that moves along its path, or follows a control: the scale readings and the
/// target position at any host time. Until the time set by start() it stands at the first vertex of
/// the path; with a control that has sent no position it stands there, too. Thread-safe.

#include <atomic>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "abbe/sim/followed_motion.hpp"
#include "abbe/sim/path_motion.hpp"
#include "abbe/sim/sim_clock.hpp"
#include "abbe/sim/truth_machine.hpp"

namespace abbe::sim {

class VirtualMachine {
 public:
  /// `followed`: the motion of a control; nullptr: the machine moves along `path`.
  VirtualMachine(TruthMachine truth, PathMotion path,
                 std::shared_ptr<const FollowedMotion> followed = nullptr)
      : truth_(std::move(truth)), path_(std::move(path)), followed_(std::move(followed)) {}

  /// The motion begins at `at`; only the first call has an effect.
  void start(HostTime at) {
    auto never = kNever;
    start_.compare_exchange_strong(never, at.time_since_epoch().count());
  }
  [[nodiscard]] std::optional<HostTime> started() const {
    const auto start = start_.load();
    if (start == kNever) return std::nullopt;
    return HostTime{std::chrono::nanoseconds{start}};
  }
  /// Time at which the machine reaches the end of the path; nullopt before start().
  [[nodiscard]] std::optional<HostTime> finished() const {
    const auto start = started();
    if (!start) return std::nullopt;
    return *start + seconds_to_ns(path_.duration_s());
  }

  /// The scale readings q, m.
  [[nodiscard]] AxisMotion motion(HostTime at) const {
    if (followed_) {
      if (const auto motion = followed_->at(at)) return *motion;
    }
    return path_.at(elapsed_s(at));
  }
  [[nodiscard]] bool follows_a_control() const { return followed_ != nullptr; }
  /// The true position of the target, machine coordinates, m.
  [[nodiscard]] Eigen::Vector3d target_m(HostTime at) const {
    const AxisMotion m = motion(at);
    return position_m(truth_, m.q_m, {m.direction, truth_.thermal.heat_after(elapsed_s(at))});
  }

  /// Time since the start of the motion; -1 before start().
  [[nodiscard]] double elapsed_s(HostTime at) const {
    const auto start = started();
    return start ? ns_to_seconds(at - *start) : -1.0;
  }

  [[nodiscard]] const TruthMachine& truth() const { return truth_; }
  [[nodiscard]] const PathMotion& path() const { return path_; }

 private:
  static constexpr auto kNever = std::numeric_limits<std::int64_t>::max();

  TruthMachine truth_;
  PathMotion path_;
  std::shared_ptr<const FollowedMotion> followed_;
  std::atomic<std::int64_t> start_{kNever};  ///< ns of HostTime
};

}  // namespace abbe::sim
