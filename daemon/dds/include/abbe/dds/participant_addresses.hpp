#pragma once
/// The network addresses that the participants of a domain announce, for messages about a
/// participant. The addresses are not checked: a participant may announce any. Thread-safe.

#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <map>
#include <mutex>
#include <string>

#include "abbe/dds/participant.hpp"
#include "abbe/subscriber/publisher_pin.hpp"

namespace abbe::dds {

class ParticipantAddresses final : private eprosima::fastdds::dds::DomainParticipantListener {
 public:
  /// Becomes the listener of the participant, in place of an earlier one. `participant` must
  /// outlive this object.
  explicit ParticipantAddresses(Participant& participant);
  ~ParticipantAddresses() override;
  ParticipantAddresses(const ParticipantAddresses&) = delete;
  ParticipantAddresses& operator=(const ParticipantAddresses&) = delete;

  /// The announced addresses of a participant, for example "192.168.10.7", separated by commas.
  /// Empty: not known.
  [[nodiscard]] std::string of(const ParticipantId& id) const;

 private:
  void on_participant_discovery(eprosima::fastdds::dds::DomainParticipant* participant,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override;

  Participant& participant_;
  mutable std::mutex mutex_;
  std::map<ParticipantId, std::string> addresses_;
};

}  // namespace abbe::dds
