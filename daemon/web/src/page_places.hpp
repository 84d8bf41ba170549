#pragma once

#include <cstddef>
#include <map>
#include <mutex>
#include <string>

namespace abbe::web {

/// Counts the open pages: at most `most`, and of these at most three quarters for one address, so
/// that a computer that opens page after page leaves places for others. Thread-safe.
class PagePlaces {
 public:
  enum class Place { Taken, AllTaken, AllOfAddressTaken };

  explicit PagePlaces(std::size_t most) : most_(most) {}
  /// After Taken, leave() must be called once.
  [[nodiscard]] Place take(const std::string& address);
  void leave(const std::string& address);
  [[nodiscard]] std::size_t taken() const;
  [[nodiscard]] std::size_t most_of_address() const noexcept { return most_ - most_ / 4; }

 private:
  std::size_t most_;
  mutable std::mutex mutex_;  // of the members below
  std::size_t taken_ = 0;
  std::map<std::string, std::size_t> of_address_;
};

}  // namespace abbe::web
