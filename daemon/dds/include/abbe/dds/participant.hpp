#pragma once
/// The one DDS participant of a process, made from an XML profile that the site may replace.
/// Thread-safe as far as Fast DDS is; create and destroy it from one thread.

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

/// Highest domain whose ports, by the default rule 7400 + 250 x domain, are UDP ports
/// [DDSI-RTPS 2.5, 9.6.2.3].
inline constexpr std::uint32_t kHighestDomain = 232;

struct ParticipantOptions {
  std::uint32_t domain = 0;
  std::filesystem::path
      profiles;  ///< XML file with a participant profile "abbe"; empty: the built-in abbe-dds.xml
  std::filesystem::path
      security;  ///< keys as `abbe dds keys` makes them; empty: what the profile says
  daemon::DdsRole role = daemon::DdsRole::Subscriber;
};

class Participant {
 public:
  /// Error: Usage for a domain above kHighestDomain, BadInput for a profile that cannot be read or
  /// has no participant "abbe", and for keys that cannot be used, Io if no participant can be
  /// created (no port), or no interface of the profile is up.
  [[nodiscard]] static Result<Participant> create(const ParticipantOptions& options);

  /// The topic with its payload type, registered without TypeObject and TypeInformation. Error Io:
  /// Fast DDS refuses.
  [[nodiscard]] Result<eprosima::fastdds::dds::Topic*> topic(daemon::Topic topic);

  [[nodiscard]] eprosima::fastdds::dds::DomainParticipant& get() const noexcept {
    return *participant_;
  }

  /// Keys of `security` or of the profile keep strangers out.
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
