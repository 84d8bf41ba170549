#include "abbe/dds/participant.hpp"

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/log/Log.hpp>
#include <fastdds/dds/log/StdoutErrConsumer.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <string>
#include <utility>

#include "abbe/dds/payload_type.hpp"
#include "abbe/result/try.hpp"
#include "abbe/subscriber/message_filter.hpp"
#include "builtin_profile.hpp"
#include "interfaces.hpp"

namespace abbe::dds {
namespace {

namespace fast = eprosima::fastdds::dds;
const auto kSuccess = eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK;

/// Number of ports that Fast DDS tries for its participant. With its default of 100, participants
/// after the first hundred on a computer would receive nothing, and no error would be reported.
constexpr std::uint32_t kMostParticipantsOfAHost = 400;

/// Most participants of the domain, and most endpoints of each, that Fast DDS keeps. Without a
/// limit, another participant that announces endpoints without end would exhaust the memory.
constexpr std::size_t kMostParticipants = 512, kMostEndpointsEach = 16;

void limit_memory(fast::DomainParticipantQos& qos) {
  auto& allocation = qos.allocation();
  const auto limit = [](auto& collection, std::size_t most) {
    collection.maximum = std::min(collection.maximum, most);
  };
  limit(allocation.participants, kMostParticipants);
  for (auto* endpoints : {&allocation.readers, &allocation.writers})
    limit(*endpoints, kMostEndpointsEach);
}

/// Directs the log of Fast DDS to stderr. By default its errors go to stdout, which is reserved for
/// the output of the program.
void log_to_stderr() {
  auto consumer = std::make_unique<fast::StdoutErrConsumer>();
  consumer->stderr_threshold(fast::Log::Kind::Info);
  fast::Log::ClearConsumers();
  fast::Log::RegisterConsumer(std::move(consumer));
}

Result<fast::DomainParticipantQos> read_profile(const std::filesystem::path& file) {
  // Without this variable Fast DDS would also load a DEFAULT_FASTRTPS_PROFILES.xml in the working
  // directory, which would change the profile.
  ::setenv("SKIP_DEFAULT_XML", "1", 1);
  auto* factory = fast::DomainParticipantFactory::get_instance();
  const std::string name = file.empty() ? std::string("built-in profile") : file.string();
  if (!file.empty() && !std::ifstream(file))
    return fail(ErrorCode::BadInput, name + ": cannot be read");
  const auto loaded =
      file.empty() ? factory->load_XML_profiles_string(kBuiltinProfile, sizeof(kBuiltinProfile) - 1)
                   : factory->load_XML_profiles_file(name);
  if (loaded != kSuccess)
    return fail(ErrorCode::BadInput, name + ": is not a Fast DDS XML profile file");
  fast::DomainParticipantQos qos;

  if (factory->get_participant_qos_from_profile(daemon::kDdsProfileName, qos) != kSuccess) {
    return fail(ErrorCode::BadInput,
                name + ": has no participant profile \"" + daemon::kDdsProfileName + "\"");
  }

  return qos;
}

bool has_property(const fast::DomainParticipantQos& qos, const char* name) {
  return eprosima::fastrtps::rtps::PropertyPolicyHelper::find_property(qos.properties(), name) !=
         nullptr;
}

/// True if the profile switches DDS Security on. Without an authentication plugin Fast DDS switches
/// it off, even if an access control plugin is set.
bool has_security(const fast::DomainParticipantQos& qos) {
  return has_property(qos, "dds.sec.auth.plugin") && has_property(qos, "dds.sec.access.plugin");
}

Result<void> add_security(const ParticipantOptions& options, fast::DomainParticipantQos& qos) {
  if (options.security.empty()) return {};
  if (has_property(qos, "dds.sec.auth.plugin") || has_property(qos, "dds.sec.access.plugin")) {
    return fail(ErrorCode::BadInput, options.profiles.string() +
                                         ": the profile has dds.sec properties, and security = " +
                                         options.security.string() +
                                         " names keys, too: remove one of the two");
  }
  const auto identity =
      daemon::find_dds_identity(options.security, options.role, std::chrono::system_clock::now());
  ABBE_TRY(identity);
  for (const auto& [name, value] : daemon::dds_security_properties(*identity))
    qos.properties().properties().emplace_back(name, value);
  return {};
}

}  // namespace

bool Participant::is_secure() const {
  return has_security(participant_->get_qos());
}

void Participant::Deleter::operator()(fast::DomainParticipant* participant) const noexcept {
  participant->delete_contained_entities();
  fast::DomainParticipantFactory::get_instance()->delete_participant(participant);
}

Result<Participant> Participant::create(const ParticipantOptions& options) {
  log_to_stderr();
  if (options.domain > kHighestDomain) {
    return fail(ErrorCode::Usage, "domain " + std::to_string(options.domain) + ": the highest is " +
                                      std::to_string(kHighestDomain));
  }

  auto qos = read_profile(options.profiles);
  ABBE_TRY(qos);

  // If no interface is up, Fast DDS creates a participant that sends nothing and reports no error.
  ABBE_TRY(interface_of_profile_is_up(*qos));
  ABBE_TRY(add_security(options, *qos));

  // The value is set here because the profile of a site may have been written before this value was
  // added to the built-in profile.
  auto& tries = qos->wire_protocol().builtin.mutation_tries;
  tries = std::max(tries, kMostParticipantsOfAHost);

  limit_memory(*qos);

  auto allowed = white_list(*qos);
  const auto protection = !has_security(*qos)        ? Protection::None
                          : options.security.empty() ? Protection::Profile
                                                     : Protection::Messages;
  const auto window = protection == Protection::None ? std::make_shared<SequenceWindow>() : nullptr;
  for (auto& transport : qos->transport().user_transports)
    transport = with_message_filter(transport, protection, window);
  auto* participant =
      fast::DomainParticipantFactory::get_instance()->create_participant(options.domain, *qos);

  if (participant == nullptr) {
    return fail(ErrorCode::Io,
                "domain " + std::to_string(options.domain) +
                    ": no participant can be created (check ports and interfaces of the profile" +
                    (has_security(*qos) ? ", its keys and permissions)" : ")"));
  }

  return Participant(participant, std::move(allowed));
}

Result<fast::Topic*> Participant::topic(daemon::Topic topic) {
  const auto& traits = daemon::traits(topic);
  // abbe-dds both writes and reads Identity, so the topic may already exist.
  const std::string name(traits.name);
  if (auto* known = dynamic_cast<fast::Topic*>(participant_->lookup_topicdescription(name)))
    return known;
  fast::TypeSupport type(new PayloadType(topic));

  // An announced TypeInformation prevents Cyclone DDS 0.10 from matching; an announced TypeObject
  // crashes Fast DDS 2.9 participants that do not know the type.
  type->auto_fill_type_information(false);
  type->auto_fill_type_object(false);
  auto* created =
      type.register_type(participant_.get()) == kSuccess
          ? participant_->create_topic(name, type.get_type_name(), fast::TOPIC_QOS_DEFAULT)
          : nullptr;
  if (created == nullptr)
    return fail(ErrorCode::Io, "topic " + name + ": Fast DDS cannot create it");

  return created;
}

}  // namespace abbe::dds
