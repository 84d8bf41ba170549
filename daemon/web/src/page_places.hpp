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
  /// Gives a place back when it ends. Must not outlive its PagePlaces.
  class Held {
   public:
    Held() = default;
    Held(const Held&) = delete;
    Held& operator=(const Held&) = delete;
    ~Held() {
      if (places_ != nullptr) places_->leave(network_);
    }

   private:
    friend PagePlaces;
    PagePlaces* places_ = nullptr;
    std::string network_;
  };

  /// After Taken, `held` has the place; it must not have one before. `network`: client_network().
  [[nodiscard]] Place take(const std::string& network, Held& held);
  [[nodiscard]] std::size_t taken() const;
  [[nodiscard]] std::size_t most_of_address() const noexcept { return most_ - most_ / 4; }

 private:
  void leave(const std::string& network);

  std::size_t most_;
  mutable std::mutex mutex_;  // of the members below
  std::size_t taken_ = 0;
  std::map<std::string, std::size_t> of_network_;
};

}  // namespace abbe::web
