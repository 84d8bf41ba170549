#pragma once
/// The DDS writers of a participant, one per topic of abbe. Used by one thread.

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
  /// `participant` must outlive the writers. Error Io: Fast DDS does not create a writer (security
  /// permissions, resources).
  [[nodiscard]] static Result<Writers> create(Participant& participant);

  /// Writes the payload unchanged. False if Fast DDS did not accept it.
  bool write(daemon::Topic topic, std::span<const std::byte> payload) override;

  void dispose(daemon::Topic topic, std::span<const std::byte> payload) override;

  /// The payload of the Identity that was written last; empty: none was written.
  [[nodiscard]] std::span<const std::byte> identity() const noexcept { return identity_; }

  /// Asserts the liveliness of the ModelState writer.
  void assert_liveliness() override;

  /// Repeats the announcement of a writer to every discovered participant, with a heartbeat of the
  /// discovery protocol. `index` < announced(). With DDS Security only an additional writer without
  /// readers is announced: with every announcement Fast DDS sends the keys of a writer to all of
  /// its readers again, and that crashes Cyclone DDS 0.10 (daemon/docs/dds.md, "Found again").
  void announce(std::size_t index);
  [[nodiscard]] std::size_t announced() const noexcept { return announced_.size(); }

  /// Waits until every reader has acknowledged ModelState, at most `at_most`.
  void wait_for_state_acknowledged(std::chrono::milliseconds at_most);

 private:
  Writers() = default;
  std::array<eprosima::fastdds::dds::DataWriter*, daemon::kTopicCount> writers_{};
  std::vector<eprosima::fastdds::dds::DataWriter*> announced_;
  Payload buffer_;
  std::vector<std::byte> identity_;
};

}  // namespace abbe::dds
