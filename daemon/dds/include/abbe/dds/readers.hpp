#pragma once
/// Readers of the abbe topics, for subscribers: the received payloads, their writers, and whether
/// a writer of ModelState is alive. Used by one thread.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "abbe/dds/participant.hpp"
#include "abbe/subscriber/publisher_pin.hpp"

namespace abbe::dds {

/// The GUID of a DDS writer. Every machine has its own publisher with its own writers.
using WriterId = std::array<std::uint8_t, 16>;

[[nodiscard]] ParticipantId participant_of(const WriterId& writer) noexcept;

struct Arrival {
  daemon::Topic topic;
  std::span<const std::byte> payload;
  WriterId writer;
};

class Readers {
 public:
  using OnArrival = std::function<void(const Arrival&)>;

  /// `participant` must outlive the readers. Error Io: Fast DDS does not create a reader.
  [[nodiscard]] static Result<Readers> create(Participant& participant,
                                              std::span<const daemon::Topic> topics);
  ~Readers();
  Readers(Readers&&) noexcept;
  Readers& operator=(Readers&&) noexcept;

  /// Returns when a sample has arrived, the liveliness of a ModelState writer has changed, or
  /// `at_most` is over.
  void wait(std::chrono::milliseconds at_most);

  /// Calls `on_arrival` for every sample that has arrived, topic by topic in the order given to
  /// create(). Before each of these samples it also passes the Identities that have arrived by
  /// then. The payload is not validated and may come from any participant: use daemon::decode.
  void take(const OnArrival& on_arrival);

  /// True while this writer of ModelState keeps its lease; false also if `topics` of create() did
  /// not contain ModelState.
  [[nodiscard]] bool is_alive(const WriterId& writer) const;

 private:
  struct State;
  explicit Readers(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::dds
