#pragma once
/// The DDS participant of a process (one per process), created from an XML profile. A site may
/// replace the built-in profile. As thread-safe as Fast DDS; create and destroy it from one thread.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/messages/dds_security.hpp"
#include "abbe/messages/topics.hpp"

namespace eprosima::fastdds::dds {
class DomainParticipant;
class Topic;
}  // namespace eprosima::fastdds::dds

namespace abbe::dds {

using daemon::Error;
using daemon::ErrorCode;
using daemon::Result;

/// Highest domain whose port numbers, by the default rule 7400 + 250 x domain, are valid UDP port
/// numbers [DDSI-RTPS 2.5, 9.6.2.3].
inline constexpr std::uint32_t kHighestDomain = 232;

struct ParticipantOptions {
  std::uint32_t domain = 0;
  /// XML file with a participant profile "abbe"; empty: the built-in abbe-dds.xml
  std::filesystem::path profiles;
  /// folder of keys from `abbe dds keys`; empty: the security settings of the profile apply
  std::filesystem::path security;
  daemon::DdsRole role = daemon::DdsRole::Subscriber;
};

class Participant {
 public:
  /// Errors:
  /// - Usage: the domain is above kHighestDomain.
  /// - BadInput: the profile cannot be read or has no participant "abbe", or the keys cannot be
  ///   used.
  /// - Io: no participant can be created (no port), or no interface of the profile is up.
  [[nodiscard]] static Result<Participant> create(const ParticipantOptions& options);

  /// Creates the DDS topic with its payload type, which is registered without TypeObject and
  /// TypeInformation. Error Io if Fast DDS does not create the topic.
  [[nodiscard]] Result<eprosima::fastdds::dds::Topic*> topic(daemon::Topic topic);

  [[nodiscard]] eprosima::fastdds::dds::DomainParticipant& get() const noexcept {
    return *participant_;
  }

  /// True if DDS Security is on, with the keys of `security` or of the profile: participants
  /// without keys can neither publish nor read.
  [[nodiscard]] bool is_secure() const;

  /// IPv4 addresses that the profile allows (interfaceWhiteList); empty: all.
  [[nodiscard]] const std::vector<std::string>& allowed_addresses() const noexcept {
    return allowed_addresses_;
  }

 private:
  struct Deleter {
    void operator()(eprosima::fastdds::dds::DomainParticipant* participant) const noexcept;
  };
  Participant(eprosima::fastdds::dds::DomainParticipant* participant,
              std::vector<std::string> allowed)
      : participant_(participant), allowed_addresses_(std::move(allowed)) {}
  std::unique_ptr<eprosima::fastdds::dds::DomainParticipant, Deleter> participant_;
  std::vector<std::string> allowed_addresses_;
};

}  // namespace abbe::dds
