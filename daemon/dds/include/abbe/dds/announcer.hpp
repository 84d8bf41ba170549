#pragma once
/// Announces the writers again: soon after another participant is discovered, and every 2 s.
/// - Cyclone DDS misses the first heartbeat of Fast DDS's discovery, and the next would come 1 s later; an
///   announcement comes with a heartbeat.
/// - One side may forget the other while the other does not, after an outage longer than one lease and
///   shorter than the other, or after this process was stopped. Fast DDS takes what it announced for known
///   then, and the subscriber would never find the writers again.
/// Used by the thread that writes, between its writes; the participant's threads only report discoveries.

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
  static constexpr std::chrono::milliseconds kFirst{
      20};  ///< after a discovery; then twice as long each time
  static constexpr std::chrono::milliseconds kPeriod{2000};  ///< at most

  /// Both must outlive this.
  Announcer(Participant& participant, Writers& writers);
  ~Announcer() override;
  Announcer(const Announcer&) = delete;
  Announcer& operator=(const Announcer&) = delete;

  /// Announces at most one writer: what is to be written does not wait for all. Call it in every
  /// cycle.
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
