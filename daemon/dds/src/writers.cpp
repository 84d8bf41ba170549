#include "abbe/dds/writers.hpp"

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>

#include <string>

#include "abbe/dds/qos.hpp"

namespace abbe::dds {
namespace {

std::size_t index_of(daemon::Topic topic) {
  return static_cast<std::size_t>(topic);
}

}  // namespace

Result<Writers> Writers::create(Participant& participant) {
  namespace fast = eprosima::fastdds::dds;
  Writers writers;
  auto* publisher = participant.get().create_publisher(fast::PUBLISHER_QOS_DEFAULT);
  if (publisher == nullptr) return fail(ErrorCode::Io, "publisher: Fast DDS refuses it");
  for (const auto& traits : daemon::all_topics()) {
    const auto topic = participant.topic(traits.topic);
    if (!topic) return tl::make_unexpected(topic.error());
    auto* writer = publisher->create_datawriter(*topic, writer_qos(traits.topic));
    if (writer == nullptr) {
      return fail(ErrorCode::Io,
                  "writer of " + std::string(traits.name) + ": Fast DDS refuses it (permissions?)");
    }
    writers.writers_[index_of(traits.topic)] = writer;
  }
  return writers;
}

bool Writers::write(daemon::Topic topic, std::span<const std::byte> payload) {
  buffer_.bytes.assign(payload.begin(), payload.end());
  return writers_[index_of(topic)]->write(&buffer_);
}

void Writers::dispose(daemon::Topic topic, std::span<const std::byte> payload) {
  buffer_.bytes.assign(payload.begin(), payload.end());
  // An instance that was never written is refused: then there is nothing to take back.
  static_cast<void>(
      writers_[index_of(topic)]->dispose(&buffer_, eprosima::fastrtps::rtps::c_InstanceHandle_Unknown));
}

void Writers::assert_liveliness() {
  writers_[index_of(daemon::Topic::ModelState)]->assert_liveliness();
}

void Writers::wait_for_state_acknowledged(std::chrono::milliseconds at_most) {
  const eprosima::fastrtps::Duration_t patience(static_cast<double>(at_most.count()) / 1e3);
  writers_[index_of(daemon::Topic::ModelState)]->wait_for_acknowledgments(patience);
}

}  // namespace abbe::dds
