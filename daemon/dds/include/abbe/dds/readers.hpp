#pragma once
/// Readers of topics of abbe, for programs that subscribe: payloads as they arrive, and whether somebody
/// answers for the state of the model. Used by one thread.

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <span>

#include "abbe/dds/participant.hpp"

namespace abbe::dds {

class Readers {
 public:
  using OnPayload = std::function<void(daemon::Topic, std::span<const std::byte>)>;

  /// `participant` must outlive the readers. Error Io: Fast DDS refuses one.
  [[nodiscard]] static Result<Readers> create(Participant& participant,
                                              std::span<const daemon::Topic> topics);
  ~Readers();
  Readers(Readers&&) noexcept;
  Readers& operator=(Readers&&) noexcept;

  /// Returns when something arrived, the liveliness of ModelState's writer changed, or the time is over.
  void wait(std::chrono::milliseconds at_most);

  /// Everything that has arrived, topic by topic in the order given to create(). Bytes are a stranger's:
  /// decode them.
  void take(const OnPayload& on_payload);

  /// Writers of ModelState that keep their lease; false also if ModelState was not asked for.
  [[nodiscard]] bool state_is_answered_for() const;

 private:
  struct State;
  explicit Readers(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::dds
