#pragma once
/// Repeats the discovery announcements of the writers: soon after another participant is
/// discovered, then every 2 s. There are two reasons:
/// - Cyclone DDS misses the first heartbeat of Fast DDS's discovery, and Fast DDS sends the next
///   one 1 s later. Every announcement that this class causes is sent with a heartbeat.
/// - After an outage longer than the lease of one participant and shorter than that of the other,
///   or after this process was suspended, only one of the two has dropped the other. Fast DDS then
///   regards its announcements as acknowledged and does not repeat them, so that the subscriber
///   would never find the writers again.
///
/// Used by the thread that writes, between its writes; the participant's threads only report
/// discoveries.

#include <atomic>
#include <chrono>
#include <cstddef>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>

#include "abbe/dds/participant.hpp"
#include "abbe/dds/writers.hpp"

namespace abbe::dds {

class Announcer final : private eprosima::fastdds::dds::DomainParticipantListener {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  /// First interval after a discovery; every further interval is twice as long, up to kPeriod.
  static constexpr std::chrono::milliseconds kFirst{20};
  static constexpr std::chrono::milliseconds kPeriod{2000};

  /// Both arguments must outlive this object.
  Announcer(Participant& participant, Writers& writers);
  ~Announcer() override;
  Announcer(const Announcer&) = delete;
  Announcer& operator=(const Announcer&) = delete;

  /// Announces at most one writer, so that samples to be written do not wait until all writers are
  /// announced. Call it in every cycle.
  void cycle(WallTime now);

 private:
  void on_participant_discovery(eprosima::fastdds::dds::DomainParticipant* participant,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override;

  Participant& participant_;
  Writers& writers_;
  std::atomic<bool> discovered_{true};
  std::chrono::milliseconds interval_{kFirst};
  WallTime next_round_{};
  std::size_t next_writer_ = 0;
};

}  // namespace abbe::dds
