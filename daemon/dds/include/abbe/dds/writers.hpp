#pragma once
/// One writer per topic of the table, in one participant. Used by one thread.

#include <array>
#include <chrono>
#include <cstddef>
#include <span>
#include <vector>

#include "abbe/dds/participant.hpp"
#include "abbe/dds/payload_type.hpp"
#include "abbe/messages/dds_bridge.hpp"

namespace eprosima::fastdds::dds {
class DataWriter;
}

namespace abbe::dds {

class Writers final : public daemon::DdsOutlet {
 public:
  /// `participant` must outlive the writers. Error Io: Fast DDS refuses one (security permissions,
  /// resources).
  [[nodiscard]] static Result<Writers> create(Participant& participant);

  /// False if Fast DDS did not take it. A payload is written as it is.
  bool write(daemon::Topic topic, std::span<const std::byte> payload) override;

  void dispose(daemon::Topic topic, std::span<const std::byte> payload) override;

  /// Says to the readers of ModelState: somebody answers for it.
  void assert_liveliness() override;

  /// Sends the announcement of a writer once more, to every participant that is known, with a
  /// heartbeat of discovery. `index` < announced(). With DDS Security that is one more writer,
  /// which has no readers: with every announcement Fast DDS sends a writer's keys to all of its
  /// readers again, and Cyclone DDS 0.10 does not survive that (daemon/docs/dds.md, "Found again").
  void announce(std::size_t index);
  [[nodiscard]] std::size_t announced() const noexcept { return announced_.size(); }

  /// Waits until every reader has acknowledged ModelState, or the time is over.
  void wait_for_state_acknowledged(std::chrono::milliseconds at_most);

 private:
  Writers() = default;
  std::array<eprosima::fastdds::dds::DataWriter*, daemon::kTopicCount> writers_{};
  std::vector<eprosima::fastdds::dds::DataWriter*> announced_;
  Payload buffer_;
};

}  // namespace abbe::dds
