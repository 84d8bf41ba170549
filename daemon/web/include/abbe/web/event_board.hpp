#pragma once
/// The latest event of each topic, for all open pages (server-sent events, WHATWG HTML 9.2). A page
/// that reads slowly skips events: nothing is queued for it, so that its memory does not grow.
/// Thread-safe.

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

namespace abbe::web {

enum class Topic : std::uint8_t {
  Source,       ///< whether abbed answers
  Status,       ///< the answer to "status"
  Live,         ///< axis positions
  Calibration,  ///< a session began
  Store,        ///< models or recordings changed
  Notice,  ///< a task for the administrator, e.g. an expiring certificate: PageServer::notice()
};
inline constexpr std::size_t kTopics = 6;

class EventBoard {
 public:
  /// Replaces the event of the topic. `json` is one line.
  void post(Topic topic, std::string_view json);
  /// Wakes all that wait, for the end of the server.
  void close();

  /// What a page has received.
  class Reader {
   public:
    /// Waits until a topic has an event that this page has not received, and returns all of them as
    /// text of the stream. Empty after `time_out`; nullopt once the board is closed.
    [[nodiscard]] std::optional<std::string> next(EventBoard& board,
                                                  std::chrono::milliseconds time_out);

   private:
    std::array<std::uint64_t, kTopics> seen_{};
  };

 private:
  struct Entry {
    std::uint64_t number = 0;  ///< of the event; 0: none yet
    std::shared_ptr<const std::string> text;
  };

  std::mutex mutex_;
  std::condition_variable changed_;
  std::array<Entry, kTopics> entries_;
  bool closed_ = false;
};

}  // namespace abbe::web
