#pragma once
/// Sends the daemon's data to abbe-dds, each topic with its own timing:
/// - live topics (Snapshot, Compensation) at their configured rates;
/// - ErrorModel and ErrorGrid when the model changes;
/// - ModelState when it changes and every second, because it contains an age; Identity before each
///   ModelState, so that a subscriber knows the machine to which the state belongs;
/// - Health every second and when it changes.
///
/// abbe-dds repeats durable topics for late joiners. Periods are CLOCK_MONOTONIC time, also with
/// simulated devices. Used by the hub's thread only.

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "abbe/messages/dds_link.hpp"
#include "abbe/pipeline/session_status.hpp"
#include "abbe/pipeline/stream_health.hpp"
#include "abbe/publishing/idl_messages.hpp"
#include "abbe/publishing/model_publication.hpp"

namespace abbe::daemon {

struct PublisherOptions {
  std::string machine;
  std::array<double, 3> tool_offset_m{};
  double snapshot_hz = 50.0;       ///< 0: with every hub cycle that has new data
  double compensation_hz = 100.0;  ///< 0: with every hub cycle that has new data
  /// Validity of a compensation vector, in host time.
  std::chrono::nanoseconds validity = std::chrono::milliseconds{500};
  std::string security_warning;  ///< warning that DDS Security is off; empty: it is on
  PublishedIdentity identity = {};
};

/// The present state of the active model.
struct ActiveModelState {
  v1::ModelStatus status = v1::ModelStatus::MODEL_NONE;
  std::string reason;
  const PublishedModel* model = nullptr;
  const ModelPublication* publication = nullptr;  ///< encoded messages of `model`
  std::uint64_t revision = 0;                     ///< changes whenever another model becomes active
  /// The reason why the gate refused a model that a person has nevertheless activated; empty: the
  /// gate accepted it.
  std::string refused{};
};

class Publisher {
 public:
  using WallTime = DdsLink::WallTime;

  Publisher(DdsLink link, PublisherOptions options, protocol::UtcOffset utc);

  /// Polls the link to abbe-dds and sends a beat. Call it in every cycle, after the live topics:
  /// subscribers wait for live samples, not for beats.
  void beat(WallTime wall);
  /// Call snapshot(), then compensation(), in every cycle that has new data.
  void snapshot(const protocol::Snapshot& view, protocol::HostTime now, WallTime wall);
  void compensation(const protocol::Snapshot& view, const ActiveModelState& active,
                    protocol::HostTime now, WallTime wall);
  /// Sets the identity that the next call of model() publishes. model() takes twin_seen from the
  /// link.
  void set_identity(PublishedIdentity identity) { options_.identity = std::move(identity); }
  /// Call it in every cycle. Sends the model if another model has become active, and the state if
  /// it has changed or is due.
  void model(const ActiveModelState& active, protocol::HostTime now, WallTime wall);
  void health(std::span<const StreamHealth> streams, protocol::HostTime now);
  void event(const SessionEvent& event);

  /// The reason why the last message that was not sent could not be encoded; empty: all were
  /// encoded.
  [[nodiscard]] const std::string& refusal() const noexcept { return refusal_; }
  [[nodiscard]] const DdsLink& link() const noexcept { return link_; }
  [[nodiscard]] const PublishedIdentity& identity() const noexcept { return options_.identity; }
  [[nodiscard]] const std::string& security_warning() const noexcept {
    return options_.security_warning;
  }

 private:
  template <class T>
  void send(Topic topic, const T& message, WallTime at = WallTime::clock::now());
  void send_encoded(Topic topic, std::span<const std::byte> payload);
  [[nodiscard]] Stamp stamp(protocol::HostTime now) {
    return {options_.machine, ++sequence_number_, now};
  }

  DdsLink link_;
  PublisherOptions options_;
  protocol::UtcOffset utc_;
  std::vector<std::byte> payload_;  // reused; keeps its capacity
  std::string refusal_;
  std::uint64_t sequence_number_ = 0;
  /// Limits the rate of a live topic. Exception: a sample in which an axis has become missing since
  /// the last sent sample is sent at once.
  struct Pace {
    WallTime next{};
    std::uint8_t missing_mask = 0;
  };
  static bool due(Pace& pace, const protocol::Snapshot& view, WallTime now, double rate_hz);
  Pace snapshots_, compensations_;
  WallTime next_state_{};
  v1::ModelStatus sent_status_ = v1::ModelStatus::MODEL_NONE;
  std::string sent_reason_;
  PublishedIdentity sent_identity_;
  std::uint64_t sent_revision_ = 0;
};

}  // namespace abbe::daemon
