#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>

namespace abbe::web {

/// The places of open pages: at most `most`, and of these at most three quarters for one address,
/// so that a computer that opens page after page leaves places for others.
///
/// A page reports that it reads its events. One that has not done so for some time loses its place
/// as soon as another page needs it, because the buffers of a connection take events that the page
/// does not read. Thread-safe.
class PagePlaces {
 public:
  using Clock = std::chrono::steady_clock;
  enum class Place { Taken, AllTaken, AllOfAddressTaken };
  /// From the opening of a page to its first report, and between reports. A page reports every 5 s.
  static constexpr std::chrono::seconds kFirstReport{3}, kNextReport{15};

  explicit PagePlaces(std::size_t most) : most_(most) {}
  /// Gives a place back when it ends. Must not outlive its PagePlaces.
  class Held {
   public:
    Held() = default;
    Held(const Held&) = delete;
    Held& operator=(const Held&) = delete;
    ~Held() {
      if (places_ != nullptr) places_->leave(number_);
    }
    /// Number of the place, with which the page reports.
    [[nodiscard]] std::uint64_t number() const noexcept { return number_; }
    /// True once another page has got the place.
    [[nodiscard]] bool lost() const { return places_ != nullptr && places_->is_lost(number_); }

   private:
    friend PagePlaces;
    PagePlaces* places_ = nullptr;
    std::uint64_t number_ = 0;
  };

  /// After Taken, `held` has the place; it must not have one before. `network`: client_network().
  [[nodiscard]] Place take(const std::string& network, Clock::time_point now, Held& held);
  /// The page with place `number` reads its events. Without effect if there is no such place.
  void report_reading(std::uint64_t number, Clock::time_point now);
  [[nodiscard]] std::size_t taken() const;
  [[nodiscard]] std::size_t most_of_address() const noexcept { return most_ - most_ / 4; }

 private:
  struct Page {
    std::string network;
    Clock::time_point reports_until;  ///< then the place may be given to another page
    bool lost = false;
  };
  void leave(std::uint64_t number);
  [[nodiscard]] bool is_lost(std::uint64_t number) const;
  /// Places that are not lost: all, or those of one address.
  [[nodiscard]] std::size_t count(const std::string* network) const;
  /// Withdraws the place of the page whose report is overdue for longest; false: there is none.
  bool withdraw_one(const std::string* network, Clock::time_point now);

  std::size_t most_;
  mutable std::mutex mutex_;  // of the members below
  std::map<std::uint64_t, Page> pages_;
  std::uint64_t last_number_ = 0;
};

}  // namespace abbe::web
