#include "abbe/dds/writers.hpp"

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>

#include <string>

#include "abbe/dds/qos.hpp"
#include "abbe/result/try.hpp"

namespace abbe::dds {
namespace {

std::size_t index_of(daemon::Topic topic) {
  return static_cast<std::size_t>(topic);
}

/// The additional writer without readers that is announced when DDS Security is on. Empty if the
/// permissions of the site do not allow it; a new subscriber may then need up to a second to find
/// the other writers.
std::vector<eprosima::fastdds::dds::DataWriter*> announcement_writer(
    Participant& participant, eprosima::fastdds::dds::Publisher& publisher) {
  namespace fast = eprosima::fastdds::dds;
  const std::string type(daemon::traits(daemon::Topic::CalibrationEvent).type_name);
  auto* topic =
      participant.get().create_topic("abbe/v1/Announcement", type, fast::TOPIC_QOS_DEFAULT);
  auto* writer = topic == nullptr ? nullptr
                                  : publisher.create_datawriter(
                                        topic, writer_qos(daemon::Topic::CalibrationEvent));
  if (writer == nullptr) return {};
  return {writer};
}

}  // namespace

Result<Writers> Writers::create(Participant& participant) {
  namespace fast = eprosima::fastdds::dds;
  Writers writers;
  auto* publisher = participant.get().create_publisher(fast::PUBLISHER_QOS_DEFAULT);
  if (publisher == nullptr) return fail(ErrorCode::Io, "publisher: Fast DDS cannot create it");

  for (const auto& traits : daemon::all_topics()) {
    const auto topic = participant.topic(traits.topic);
    ABBE_TRY(topic);
    auto* writer = publisher->create_datawriter(*topic, writer_qos(traits.topic));
    if (writer == nullptr) {
      return fail(ErrorCode::Io,
                  "writer of " + std::string(traits.name) +
                      ": Fast DDS cannot create it (check the permissions of the keys)");
    }
    writers.writers_[index_of(traits.topic)] = writer;
  }

  if (participant.is_secure())
    writers.announced_ = announcement_writer(participant, *publisher);
  else
    writers.announced_.assign(writers.writers_.begin(), writers.writers_.end());

  return writers;
}

bool Writers::write(daemon::Topic topic, std::span<const std::byte> payload) {
  buffer_.bytes.assign(payload.begin(), payload.end());
  if (topic == daemon::Topic::Identity) identity_ = buffer_.bytes;
  return writers_[index_of(topic)]->write(&buffer_);
}

void Writers::dispose(daemon::Topic topic, std::span<const std::byte> payload) {
  buffer_.bytes.assign(payload.begin(), payload.end());
  // Fast DDS returns an error if the instance was never written. Nothing needs to be disposed of
  // then, so the result is ignored.
  static_cast<void>(writers_[index_of(topic)]->dispose(
      &buffer_, eprosima::fastrtps::rtps::c_InstanceHandle_Unknown));
}

void Writers::assert_liveliness() {
  writers_[index_of(daemon::Topic::ModelState)]->assert_liveliness();
}

void Writers::announce(std::size_t index) {
  // Setting the QoS, even to the same values, makes Fast DDS announce the writer.
  const auto unchanged = announced_[index]->get_qos();
  announced_[index]->set_qos(unchanged);
}

void Writers::wait_for_state_acknowledged(std::chrono::milliseconds at_most) {
  const eprosima::fastrtps::Duration_t timeout(static_cast<double>(at_most.count()) / 1e3);
  writers_[index_of(daemon::Topic::ModelState)]->wait_for_acknowledgments(timeout);
}

}  // namespace abbe::dds
