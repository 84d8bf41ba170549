#pragma once
/// A hub of the daemon's own parts, the far end of its link, and a clock that the test moves.
/// Devices: what the test puts in the devices' place.

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <future>
#include <memory>
#include <optional>

#include "abbe/service/control_api.hpp"
#include "abbe/service/hub.hpp"
#include "dds_far_end.hpp"
#include "recording_fixture.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon::test {

/// Host and wall time as one, moved by the test.
class OneClock final : public drivers::TimeSource {
 public:
  [[nodiscard]] protocol::HostTime now() const noexcept override {
    return protocol::HostTime{std::chrono::seconds{100}} + passed;
  }
  [[nodiscard]] std::chrono::nanoseconds wall(
      std::chrono::nanoseconds host) const noexcept override {
    return host;
  }
  [[nodiscard]] std::chrono::nanoseconds host(
      std::chrono::nanoseconds wall) const noexcept override {
    return wall;
  }
  [[nodiscard]] Hub::WallTime wall_now() const {
    return Hub::WallTime{std::chrono::seconds{100}} + passed;
  }
  std::chrono::nanoseconds passed{};
};

/// Who may ask for everything.
inline ControlPeer myself() {
  return {.user = "me", .uid = ::geteuid()};
}

template <class Devices>
class HubBench : public ::testing::Test {
 protected:
  HubBench() {
    config_.machine.name = "mill";
    config_.machine.target_offset_m = {0.02, -0.015, -0.12};
    config_.machine.target_given = true;
  }

  /// With the configuration, the recorder and the verification as they are now.
  void make_hub() {
    authority_.emplace(ModelAuthority::open(folder_.path() / "models", config_, {}, time_.now()));
    calibration_.emplace(config_, *authority_, recorder_.get());
    publisher_.emplace(DdsLink::listen(folder_.path() / "dds.sock").value(),
                       PublisherOptions{.machine = "mill",
                                        .tool_offset_m = config_.machine.target_offset_m,
                                        .compensation_hz = 0.0},
                       protocol::UtcOffset{});
    far_.emplace(folder_.path() / "dds.sock");
    hub_.emplace(HubParts{.config = config_,
                          .time = time_,
                          .devices = devices_,
                          .authority = *authority_,
                          .calibration = *calibration_,
                          .publisher = &*publisher_,
                          .recorder = recorder_.get(),
                          .verification = verification_ ? &*verification_ : nullptr,
                          .sensors = &sensors_});
  }

  virtual void cycle(std::chrono::nanoseconds later = std::chrono::milliseconds{1}) {
    time_.passed += later;
    hub_->cycle(time_.wall_now());
  }
  /// From a thread of its own, while the hub runs its cycles.
  nlohmann::json ask(const nlohmann::json& request) {
    auto answer = std::async(std::launch::async, [&] {
      return answer_request(*hub_, request, myself(), std::chrono::seconds{60});
    });
    while (answer.wait_for(std::chrono::seconds{0}) != std::future_status::ready)
      cycle(std::chrono::nanoseconds{0});
    return answer.get();
  }
  /// As in the store; active once the hub has followed.
  [[nodiscard]] Result<KeptModel> keep_a_model() {
    auto document = synthetic_document(1);
    document.machine_hash = machine_hash(config_);
    return authority_->keeper().keep(document, {.accepted = true}, {"anna", "test", {}},
                                     time_.now());
  }

  TemporaryFolder folder_;
  OneClock time_;
  Config config_;
  Devices devices_;
  std::unique_ptr<RecorderThread> recorder_;
  std::optional<ModelAuthority> authority_;
  std::optional<CalibrationService> calibration_;
  std::optional<Publisher> publisher_;
  std::optional<FarEnd> far_;
  std::optional<VerificationService> verification_;
  SensorService sensors_{nullptr};
  std::optional<Hub> hub_;
};

}  // namespace abbe::daemon::test
