#pragma once
/// Arrivals of a laser tracker as measured: one packet every 332 ms (5-95 %: 324 to 344 ms), points
/// at 500 Hz, so 166 a packet. A packet is delayed by an unknown constant plus a varying part:
/// mostly a few ms, sometimes tens of ms.

#include <chrono>
#include <cmath>
#include <cstdint>
#include <random>

#include "abbe/protocol/time.hpp"

namespace abbe::tests {

struct Packet {
  protocol::DeviceTime last_point{};
  protocol::HostTime arrival{};
};

class BurstProfile {
 public:
  struct Truth {
    double skew = 15e-6;            ///< device clock rate - 1
    double constant_delay_s = 0.0;  ///< smallest delay there is
    double mean_jitter_s = 0.003;
    double rare_jitter_s = 0.040;  ///< one packet in twenty is late by up to this, on top
  };

  BurstProfile(std::uint64_t seed, const Truth& truth) : truth_(truth), random_(seed) {}

  Packet next() {
    closing_s_ += std::normal_distribution(0.332, 0.006)(random_);
    last_point_s_ = std::floor(closing_s_ / kPointPeriod_s) * kPointPeriod_s;
    double delay_s = truth_.constant_delay_s +
                     std::exponential_distribution(1.0 / truth_.mean_jitter_s)(random_);
    if (uniform() < 0.05) delay_s += truth_.rare_jitter_s * uniform();
    return {device_at(last_point_s_), host_at(closing_s_ + delay_s)};
  }

  /// Host seconds of the last packet's last point, and of any device instant: the truth.
  [[nodiscard]] double last_point_s() const { return last_point_s_; }
  [[nodiscard]] protocol::DeviceTime device_at(double host_s) const {
    return protocol::DeviceTime{
        std::chrono::nanoseconds{std::llround(1e9 * (777.0 + host_s * (1.0 + truth_.skew)))}};
  }
  [[nodiscard]] static protocol::HostTime host_at(double host_s) {
    return protocol::HostTime{std::chrono::nanoseconds{std::llround(1e9 * (50'000.0 + host_s))}};
  }
  double uniform() { return std::uniform_real_distribution(0.0, 1.0)(random_); }

  static constexpr double kPointPeriod_s = 0.002;

 private:
  Truth truth_;
  std::mt19937_64 random_;
  double closing_s_ = 0.0;
  double last_point_s_ = 0.0;
};

}  // namespace abbe::tests
