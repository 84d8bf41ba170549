#pragma once
/// Readers of topics of abbe, for programs that subscribe: payloads as they arrive, by whom, and
/// whether a publisher of ModelState is alive. Used by one thread.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "abbe/dds/participant.hpp"
#include "abbe/dds/publisher_pin.hpp"

namespace abbe::dds {

/// The GUID of a DDS writer. Every machine has a publisher with writers of its own.
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

  /// `participant` must outlive the readers. Error Io: Fast DDS refuses one.
  [[nodiscard]] static Result<Readers> create(Participant& participant,
                                              std::span<const daemon::Topic> topics);
  ~Readers();
  Readers(Readers&&) noexcept;
  Readers& operator=(Readers&&) noexcept;

  /// Returns when something arrived, the liveliness of ModelState's writer changed, or the time is
  /// over.
  void wait(std::chrono::milliseconds at_most);

  /// Everything that has arrived, topic by topic in the order given to create(). Bytes are a
  /// stranger's: decode them.
  void take(const OnArrival& on_arrival);

  /// Whether this writer of ModelState keeps its lease; false also if ModelState was not asked for.
  [[nodiscard]] bool is_alive(const WriterId& writer) const;

 private:
  struct State;
  explicit Readers(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::dds
