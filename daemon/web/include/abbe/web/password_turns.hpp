#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <set>
#include <string>
#include <tuple>
#include <utility>

namespace abbe::web {

/// The order in which passwords are checked, because a check takes 0.1 s of one processor. kAtOnce
/// at a time, and of one address one at a time. The address with the fewest failures is next: an
/// address that tries many passwords delays none that tries its first. Thread-safe.
class PasswordTurns {
 public:
  static constexpr std::size_t kAtOnce = 2;
  static constexpr std::size_t kMostWaiting = 64;

  /// Ends the turn when it ends. Must not outlive its PasswordTurns.
  class Turn {
   public:
    Turn() = default;
    Turn(PasswordTurns& turns, std::string address)
        : turns_(&turns), address_(std::move(address)) {}
    Turn(Turn&& other) noexcept
        : turns_(std::exchange(other.turns_, nullptr)), address_(std::move(other.address_)) {}
    Turn& operator=(Turn&&) = delete;
    ~Turn() {
      if (turns_ != nullptr) turns_->end(address_);
    }
    [[nodiscard]] explicit operator bool() const noexcept { return turns_ != nullptr; }

   private:
    PasswordTurns* turns_ = nullptr;
    std::string address_;
  };

  /// Waits for a turn; an empty one if that takes longer than `patience`, or if kMostWaiting wait.
  [[nodiscard]] Turn wait(const std::string& address, std::size_t failures,
                          std::chrono::milliseconds patience);

  [[nodiscard]] std::size_t waiting() const {
    const std::lock_guard lock(mutex_);
    return waiting_.size();
  }

 private:
  using Waiting = std::tuple<std::size_t, std::uint64_t, std::string>;  // failures, number, address
  [[nodiscard]] bool is_next(const Waiting& one) const;
  void end(const std::string& address);

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  // under mutex_
  std::set<Waiting> waiting_;
  std::set<std::string> checking_;  ///< addresses
  std::uint64_t last_number_ = 0;
};

}  // namespace abbe::web
