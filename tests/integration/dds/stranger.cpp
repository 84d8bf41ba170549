// A foreign participant on the domain, for the tests and `scripts/soak strangers`:
//   dds_stranger DOMAIN fake [KEYS]   publishes ModelState ACTIVE, Compensation and ErrorGrid of
//                                     999 um under the name of the tests' machine; KEYS: with keys
//                                     of another authority
//   dds_stranger DOMAIN twin [KEYS]   the same as another machine of this name: its Identity has
//                                     another machine_id
//   dds_stranger DOMAIN dispose       publishes and disposes instances of ErrorGrid
//   dds_stranger DOMAIN types         announces types with a sequence of structs, on a topic of
//                                     abbe and on a topic of its own
//   dds_stranger DOMAIN garbage       sends malformed RTPS to the ports of the domain's first
//                                     participants
// It runs until it is killed, and prints "started" when it begins to send.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "abbe/dds/participant.hpp"
#include "abbe/dds/writers.hpp"
#include "sample_messages.hpp"
#include "strangePubSubTypes.h"
#include "strangeTypeObject.h"

namespace {

using namespace abbe;
using namespace std::chrono_literals;
namespace fast = eprosima::fastdds::dds;

constexpr double kFake_m = 999e-6;

void report_start() {
  std::puts("started");
  std::fflush(stdout);
}

int refused(const daemon::Error& error) {
  std::fprintf(stderr, "dds_stranger: %s\n", error.text.c_str());
  return 4;
}

template <class T>
void write(abbe::dds::Writers& writers, daemon::Topic topic, const T& message) {
  std::vector<std::byte> payload;
  if (daemon::encode(message, payload)) writers.write(topic, payload);
}

int publish_fakes(abbe::dds::ParticipantOptions options, bool as_twin) {
  auto participant = abbe::dds::Participant::create(options);
  if (!participant) return refused(participant.error());
  auto writers = abbe::dds::Writers::create(*participant);
  if (!writers) return refused(writers.error());
  report_start();

  for (std::uint64_t n = 1'000'000;; ++n) {
    if (n % 10 == 0) {
      auto identity = test::identity(n);
      if (as_twin) identity.machine_id("b6f4f9a0-51c5-4b0e-9a53-0a6a0f6b7a22");
      write(*writers, daemon::Topic::Identity, identity);
      write(*writers, daemon::Topic::ModelState, test::active_state(n));
      for (auto slice : test::grid_slices()) {
        for (auto& node : slice.nodes()) node.error_m({kFake_m, kFake_m, kFake_m});
        write(*writers, daemon::Topic::ErrorGrid, slice);
      }
    }
    auto vector = test::compensation(n);
    vector.vector_m({kFake_m, kFake_m, kFake_m});
    write(*writers, daemon::Topic::Compensation, vector);
    writers->assert_liveliness();
    std::this_thread::sleep_for(10ms);
  }
}

int dispose_instances(const abbe::dds::ParticipantOptions& options) {
  auto participant = abbe::dds::Participant::create(options);
  if (!participant) return refused(participant.error());
  auto writers = abbe::dds::Writers::create(*participant);
  if (!writers) return refused(writers.error());
  report_start();

  for (std::uint32_t n = 0;; ++n) {
    for (auto slice : test::grid_slices()) {
      std::vector<std::byte> payload;
      slice.slice(slice.slice() + 2 * n % 100);
      if (!daemon::encode(slice, payload)) return 5;
      writers->write(daemon::Topic::ErrorGrid, payload);
      writers->dispose(daemon::Topic::ErrorGrid, payload);
    }
    std::this_thread::sleep_for(20ms);
  }
}

void announce_type(fast::DomainParticipant* participant, const std::string& topic_name) {
  fast::TypeSupport type(new strange::OuterPubSubType);
  auto* topic =
      participant->create_topic(topic_name, type.get_type_name(), fast::TOPIC_QOS_DEFAULT);
  auto* publisher = participant->create_publisher(fast::PUBLISHER_QOS_DEFAULT);
  if (topic == nullptr ||
      publisher->create_datawriter(topic, fast::DATAWRITER_QOS_DEFAULT) == nullptr)
    std::fprintf(stderr, "dds_stranger: no writer on %s\n", topic_name.c_str());
}

int publish_types(std::uint32_t domain) {
  auto* factory = fast::DomainParticipantFactory::get_instance();
  fast::DomainParticipantQos qos;

  if (factory->load_XML_profiles_file(ABBE_LOOPBACK_PROFILE) !=
          eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK ||
      factory->get_participant_qos_from_profile("abbe", qos) !=
          eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK)
    return 3;
  auto* participant = factory->create_participant(domain, qos);
  if (participant == nullptr) return 4;
  registerstrangeTypes();
  fast::TypeSupport(new strange::OuterPubSubType).register_type(participant);
  announce_type(participant, "abbe/v1/ModelState");
  announce_type(participant, "Strange");
  report_start();
  for (;;) ::pause();
}

/// A message with the header of RTPS and random content: existing submessage ids and entities,
/// wrong lengths.
class Garbage {
 public:
  const std::vector<std::uint8_t>& next() {
    message_.assign({'R', 'T', 'P', 'S', 2, 3, 1, 15});
    fill(12);  // an unknown participant
    for (int n = 1 + pick(4); n > 0; --n) append_submessage();
    return message_;
  }

 private:
  int pick(int below) { return static_cast<int>(random_() % static_cast<unsigned>(below)); }
  void fill(int count) {
    for (; count > 0; --count) message_.push_back(static_cast<std::uint8_t>(random_()));
  }
  void append_submessage() {
    constexpr std::array<std::uint8_t, 14> kKinds{0x01, 0x06, 0x07, 0x08, 0x09, 0x0c, 0x0e,
                                                  0x12, 0x13, 0x15, 0x16, 0x31, 0x33, 0x80};
    constexpr std::array<std::uint8_t, 5> kWriters{1, 2, 3, 4, 0x20};
    const int length = pick(200);
    const int said = pick(4) == 0 ? pick(65536) : length;
    message_.insert(message_.end(),
                    {kKinds[static_cast<std::size_t>(pick(kKinds.size()))],
                     static_cast<std::uint8_t>(random_()), static_cast<std::uint8_t>(said & 0xff),
                     static_cast<std::uint8_t>(said >> 8)});
    const std::size_t body = message_.size();
    fill(length);
    if (length < 12) return;
    const std::uint8_t writer = kWriters[static_cast<std::size_t>(pick(kWriters.size()))];

    for (std::size_t i = 0; i < 4; ++i) {
      message_[body + 4 + i] = 0;  // any reader
      message_[body + 8 + i] =
          std::array<std::uint8_t, 4>{0, writer == 1 ? std::uint8_t{1} : std::uint8_t{0},
                                      writer == 1 ? std::uint8_t{0} : writer, 0xc2}[i];
    }
  }

  std::mt19937 random_{20'261'122};
  std::vector<std::uint8_t> message_;
};

/// Ports of participant 0 to 3, metatraffic and data [DDSI-RTPS 2.5, 9.6.2.3].
int send_garbage(std::uint32_t domain) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return 4;
  report_start();
  Garbage garbage;

  for (std::uint64_t n = 0;; ++n) {
    const auto& message = garbage.next();
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = ::htonl(INADDR_LOOPBACK);
    to.sin_port = ::htons(static_cast<std::uint16_t>(7400 + 250 * domain + 10 + n % 8));
    static_cast<void>(::sendto(fd, message.data(), message.size(), 0,
                               reinterpret_cast<const sockaddr*>(&to), sizeof to));
    if (n % 10 == 0) std::this_thread::sleep_for(1ms);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const auto domain = static_cast<std::uint32_t>(std::atoi(argv[1]));
  const std::string what = argv[2];
  if (what == "types") return publish_types(domain);
  if (what == "garbage") return send_garbage(domain);
  const abbe::dds::ParticipantOptions options{.domain = domain,
                                              .profiles = ABBE_LOOPBACK_PROFILE,
                                              .security = argc > 3 ? argv[3] : "",
                                              .role = daemon::DdsRole::Daemon};
  if (what == "dispose") return dispose_instances(options);
  if (what != "fake" && what != "twin") return 2;
  return publish_fakes(options, what == "twin");
}
