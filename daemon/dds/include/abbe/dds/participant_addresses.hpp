#pragma once
/// Where the participants of a domain announce that they can be reached, for messages that name
/// one. A participant may announce what it likes. Thread-safe.

#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <map>
#include <mutex>
#include <string>

#include "abbe/dds/participant.hpp"
#include "abbe/dds/publisher_pin.hpp"

namespace abbe::dds {

class ParticipantAddresses final : private eprosima::fastdds::dds::DomainParticipantListener {
 public:
  /// Takes the participant's listener. `participant` must outlive this.
  explicit ParticipantAddresses(Participant& participant);
  ~ParticipantAddresses() override;
  ParticipantAddresses(const ParticipantAddresses&) = delete;
  ParticipantAddresses& operator=(const ParticipantAddresses&) = delete;

  /// For instance "192.168.10.7", several separated by commas; empty: not known.
  [[nodiscard]] std::string of(const ParticipantId& id) const;

 private:
  void on_participant_discovery(eprosima::fastdds::dds::DomainParticipant* participant,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override;

  Participant& participant_;
  mutable std::mutex mutex_;
  std::map<ParticipantId, std::string> addresses_;
};

}  // namespace abbe::dds
