// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// The feeder's side of the shared memory of abbe_correction (hand_over.h). One feeder may write:
/// the memory has its process id. Used by one thread, except sent().

#include <chrono>
#include <optional>
#include <string>

#include "hand_over.h"

namespace abbe::linuxcnc {

class ControlLink {
 public:
  using Clock = std::chrono::steady_clock;

  /// Attaches to the memory with this key. nullopt, with the reason in `error`: LinuxCNC does not
  /// run with abbe_correction, or another feeder writes. A feeder that was killed, or does not
  /// write for 0.3 s, is replaced.
  [[nodiscard]] static std::optional<ControlLink> attach(int key, std::string& error);
  ~ControlLink();
  ControlLink(ControlLink&& other) noexcept;
  ControlLink& operator=(ControlLink&&) = delete;

  /// Returns the values of the latest servo cycle, or those of the previous call while the values
  /// are being written.
  [[nodiscard]] const abbe_control& read();
  void write(const abbe_wanted& wanted);

  /// The reason why the feeder must end: LinuxCNC has ended (perhaps without unloading
  /// abbe_correction), or another feeder has replaced this one. Empty: it need not end. For the
  /// thread that calls read().
  [[nodiscard]] std::string ended(Clock::time_point now);
  /// True: LinuxCNC has unloaded abbe_correction.
  [[nodiscard]] bool closed() const;

  /// The values that were written last; nullopt while they are being written. Any thread.
  [[nodiscard]] std::optional<abbe_wanted> sent() const;

 private:
  ControlLink(abbe_hand_over* memory, int segment) : memory_(memory), segment_(segment) {}
  abbe_hand_over* memory_;
  int segment_;  ///< id of memory_
  abbe_control control_{};
  std::uint64_t seen_cycle_ = 0;
  Clock::time_point cycled_at_ = Clock::now();
};

}  // namespace abbe::linuxcnc
