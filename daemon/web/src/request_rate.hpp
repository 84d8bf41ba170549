#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <string>

namespace abbe::web {

/// Limits the requests of each client (client_network()): `at_once` at any time, `per_second` on
/// average (token bucket). Thread-safe.
class RequestRate {
 public:
  using Clock = std::chrono::steady_clock;
  RequestRate(double per_second, double at_once) : per_second_(per_second), at_once_(at_once) {}
  /// False if the request exceeds the limit.
  [[nodiscard]] bool take(const std::string& network, Clock::time_point now);

 private:
  struct Bucket {
    double left = 0.0;
    Clock::time_point at;
  };
  void forget_full_ones(Clock::time_point now);

  double per_second_, at_once_;
  std::mutex mutex_;
  std::map<std::string, Bucket> buckets_;
};

}  // namespace abbe::web
