#pragma once
/// Hands what the daemon knows to abbe-dds, each topic in its own rhythm: live vectors at their
/// rates, model and grid when they change, state when it changes and every second (its age moves),
/// health every second and when it changes. abbe-dds repeats durable topics for late joiners by
/// itself. Rhythms run in wall time, also with simulated devices. Used by the hub's thread only.

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
  double snapshot_hz = 50.0;       ///< 0: whenever something new came
  double compensation_hz = 100.0;  ///< 0: whenever something new came
  /// of a live vector, host time
  std::chrono::nanoseconds validity = std::chrono::milliseconds{500};
  std::string security_warning;  ///< what to report of DDS Security; empty: it is on
};

/// What may be said of the model in force at this moment.
struct ModelStanding {
  v1::ModelStatus status = v1::ModelStatus::MODEL_NONE;
  std::string reason;
  const ModelInForce* model = nullptr;
  const ModelPublication* publication = nullptr;  ///< of `model`
  std::uint64_t revision = 0;  ///< changes whenever another model comes into force
};

class Publisher {
 public:
  using WallTime = DdsLink::WallTime;

  Publisher(DdsLink link, PublisherOptions options, protocol::UtcOffset utc);

  /// Every turn, behind what subscribers wait for: says the daemon is alive and lets the link
  /// breathe.
  void beat(WallTime wall);
  /// Every turn in which something new came; the snapshot first, subscribers wait for it.
  void snapshot(const protocol::Snapshot& view, protocol::HostTime now, WallTime wall);
  void compensation(const protocol::Snapshot& view, const ModelStanding& standing,
                    protocol::HostTime now, WallTime wall);
  /// Every turn.
  void model(const ModelStanding& standing, protocol::HostTime now, WallTime wall);
  void health(std::span<const StreamHealth> streams, protocol::HostTime now);
  void event(const SessionEvent& event);

  /// Why the last message that could not be encoded was not sent; empty: all could.
  [[nodiscard]] const std::string& refusal() const noexcept { return refusal_; }
  [[nodiscard]] const DdsLink& link() const noexcept { return link_; }
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
  std::vector<std::byte> payload_;  // reused
  std::string refusal_;
  std::uint64_t sequence_number_ = 0;
  /// How often a live vector may go; one that takes back what went before it goes at once.
  struct Pace {
    WallTime next{};
    protocol::HostTime time{};
    std::uint8_t missing_mask = 0;
  };
  static bool due(Pace& pace, const protocol::Snapshot& view, WallTime now, double rate_hz);
  Pace snapshots_, compensations_;
  WallTime next_state_{};
  v1::ModelStatus sent_status_ = v1::ModelStatus::MODEL_NONE;
  std::string sent_reason_;
  std::uint64_t sent_revision_ = 0;
};

}  // namespace abbe::daemon
