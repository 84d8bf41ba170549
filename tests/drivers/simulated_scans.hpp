#pragma once
/// Scans of a counter card that watches a probe touch again and again, computed from the truth:
/// constant speed through each contact, scales that count, a clock that counts, a latch, an edge
/// counter. Independent of the touch detector.

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include "abbe/drivers/counter_card/scan.hpp"

namespace abbe::tests {

struct SimulatedProbe {
  double speed_m_s = 4e-3;
  std::array<double, 3> direction = {0.6, 0.0, -0.8};
  double delay_s = 5e-6;
  double jitter_s = 1e-6;
  double clock_hz = 10e6;
  double scan_period_s = 1.0 / 33'333.0;
  double count_m = 10e-9;
  std::vector<double> chatter_s;  ///< further edges, after the first
  bool latch_wired = true;
  std::int64_t latch_wrong_by = 0;  ///< counts added to every latch
};

/// One approach of 4 ms, retract at twice the speed, again after 6 ms; contact in its middle, where
/// exactly is drawn.
class SimulatedScans {
 public:
  static constexpr double kPeriod_s = 6e-3;
  static constexpr double kForward_s = 4e-3;

  SimulatedScans(const SimulatedProbe& probe, unsigned seed) : probe_(probe), random_(seed) {
    draw();
  }

  drivers::CounterScan next() {
    if (t_ >= 6e-3 * static_cast<double>(touch_ + 1)) {
      ++touch_;
      draw();
    }

    drivers::CounterScan s;
    while (!edges_.empty() && edges_.front() <= t_) {
      ++edge_count_;
      latched_ = true;
      latch_ = count(edges_.front()) + probe_.latch_wrong_by;
      edges_.erase(edges_.begin());
    }

    s.axes.head.time = protocol::HostTime{std::chrono::hours{1} + ns(t_)};
    s.axes.cycle = cycle_++;
    s.axes.axis_count = 3;

    for (std::size_t i = 0; i < 3; ++i) {
      s.axes.count[i] = std::llround(position(i, t_) / probe_.count_m);
      s.axes.position[i] = static_cast<double>(s.axes.count[i]) * probe_.count_m;
    }

    s.clock_count = count(t_);
    s.latched = latched_ && probe_.latch_wired;
    s.latch_count = s.latched ? latch_ : 0;
    s.edge_count = edge_count_;
    t_ += probe_.scan_period_s;

    return s;
  }

  /// Of the contact in the approach that is going on.
  [[nodiscard]] double contact_s() const { return contact_; }
  [[nodiscard]] double contact_m(std::size_t axis) const { return position(axis, contact_); }
  [[nodiscard]] std::uint32_t touch() const { return touch_; }
  [[nodiscard]] double now_s() const { return t_; }
  static std::chrono::nanoseconds ns(double s) {
    return std::chrono::nanoseconds{std::llround(1e9 * s)};
  }

 private:
  void draw() {
    std::uniform_real_distribution<double> where{1.6e-3, 2.2e-3};
    std::normal_distribution<double> jitter{0.0, 1.0};
    contact_ = kPeriod_s * static_cast<double>(touch_) + where(random_);
    const double edge = contact_ + probe_.delay_s + probe_.jitter_s * jitter(random_);
    edges_.push_back(edge);
    for (const double later : probe_.chatter_s) edges_.push_back(edge + later);
  }
  [[nodiscard]] double position(std::size_t axis, double t) const {
    const double phase = t - kPeriod_s * std::floor(t / kPeriod_s);
    const double way = phase < kForward_s ? phase : kForward_s - 2.0 * (phase - kForward_s);
    return 0.1 + probe_.direction[axis] * probe_.speed_m_s * way;
  }
  [[nodiscard]] std::int64_t count(double t) const {
    return static_cast<std::int64_t>(std::floor((t + 1.0) * probe_.clock_hz));
  }

  SimulatedProbe probe_;
  std::mt19937 random_;
  double t_ = 1e-5;
  double contact_ = 0.0;
  std::uint32_t touch_ = 0;
  std::uint32_t cycle_ = 0;
  std::vector<double> edges_;
  std::int64_t edge_count_ = 0;
  std::int64_t latch_ = 0;
  bool latched_ = false;
};

}  // namespace abbe::tests
