#pragma once
/// Passes environment samples to SensorChecks in an order that does not depend on their arrival, so
/// that pipeline, live view, recorder and replay get the same values. A sample of an environment
/// device is due `lag` after its instant: by then the earlier samples of all devices have arrived.
/// A sample of the tracker's weather station is due in the cycle that took it. Deterministic; not
/// for the RT path; not thread-safe.

#include <chrono>
#include <cstddef>
#include <utility>
#include <vector>

#include "abbe/pipeline/sensor_acceptance.hpp"
#include "abbe/pipeline/sensor_checks.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::daemon {

/// Largest time by which the instant of a sample may be later than the cycle that took it. A later
/// instant is a fault of the device's clock. If it were accepted, all further samples of its
/// sensors up to that instant would be ignored.
inline constexpr std::chrono::seconds kMostAhead{1};

class SensorQueue {
 public:
  struct Waiting {
    protocol::HostTime due{};
    bool weather = false;
    std::size_t device = 0;  ///< index of the device as passed to add()
    protocol::EnvironmentMask mask = 0;
    protocol::EnvironmentSample sample;
  };

  SensorQueue(SensorCheckOptions options, std::chrono::nanoseconds lag)
      : checks_(std::move(options)), lag_(lag) {}

  /// `taken`: time of the cycle; HostTime{}: not known. A sample dated later than `taken` by more
  /// than kMostAhead is not used and counts as a doubt.
  void add(std::size_t device, const protocol::EnvironmentSample& sample,
           protocol::EnvironmentMask mask, protocol::HostTime taken);
  /// Same as add(), for a sample of the tracker's weather station. The sample is due at `taken`, or
  /// at its own instant if `taken` is not known.
  void add_weather(std::size_t device, const protocol::EnvironmentSample& sample,
                   protocol::EnvironmentMask mask, protocol::HostTime taken);

  /// The acceptance applies to the samples that become due after its instant.
  void accept(SensorAcceptance acceptance);

  /// Checks the samples that are due at `t` and calls use(const Waiting&, const
  /// CheckedEnvironment&) for each of them.
  template <class Use>
  void check_until(protocol::HostTime t, Use use) {
    std::size_t done = 0;
    for (; done < waiting_.size() && waiting_[done].due <= t; ++done) {
      accept_before(waiting_[done].due);
      use(waiting_[done], checks_.checked(waiting_[done].sample, waiting_[done].mask));
    }
    waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(done));
    accept_before(t);
  }

  /// Samples that are not checked yet, in the order in which they will be checked.
  [[nodiscard]] const std::vector<Waiting>& waiting() const noexcept { return waiting_; }
  [[nodiscard]] SensorChecks& checks() noexcept { return checks_; }
  [[nodiscard]] const SensorChecks& checks() const noexcept { return checks_; }

 private:
  void insert(const Waiting& waiting, protocol::HostTime taken);
  void accept_before(protocol::HostTime due);

  SensorChecks checks_;
  std::chrono::nanoseconds lag_;
  std::vector<Waiting> waiting_;
  /// acceptances that are not applied yet, ordered by time
  std::vector<SensorAcceptance> acceptances_;
};

}  // namespace abbe::daemon
