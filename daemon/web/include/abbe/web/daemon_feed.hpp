#pragma once
/// Asks abbed over the control socket, for all pages together, and posts its answers on the event
/// board. One thread of its own and one connection: the load of abbed does not depend on the number
/// of pages. While no page is open it asks less often.

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "abbe/base/control_connection.hpp"
#include "abbe/config/web_config.hpp"
#include "abbe/web/curve_history.hpp"
#include "abbe/web/event_board.hpp"

namespace abbe::web {

/// The path that the machine has driven in the present or last session.
struct DrivenPath {
  std::uint64_t session = 0;
  std::vector<std::array<double, 3>> points_m;  ///< scale readings; at most kMostPathPoints
};
inline constexpr std::size_t kMostPathPoints = 8000;

class DaemonFeed {
 public:
  /// Called on the thread of the feed: `pages`, the number of open pages; `notice`, what the pages
  /// show besides, empty: nothing.
  DaemonFeed(const daemon::WebSettings& settings, EventBoard& board,
             std::function<std::size_t()> pages, std::function<std::string()> notice);
  DaemonFeed(const DaemonFeed&) = delete;
  DaemonFeed& operator=(const DaemonFeed&) = delete;
  ~DaemonFeed();

  /// The last answer to "status", null before the first and while abbed does not answer. Any
  /// thread.
  [[nodiscard]] nlohmann::json status() const;
  /// {"session", "request", "driven_mm", "bars": see bars_of()} of the present or last session; the
  /// request as abbed received it, lengths in m. Any thread.
  [[nodiscard]] nlohmann::json calibration() const;

  /// What was answered in the last 8 h, at most twice a second while no page is open.
  [[nodiscard]] const CurveHistory& curves() const noexcept { return curves_; }

  using Clock = std::chrono::steady_clock;
  /// Why abbed is not asked any more; empty: it is asked, whether it answers or not. Any thread.
  [[nodiscard]] std::string fault(Clock::time_point now) const;

 private:
  void run();
  void cycle(Clock::time_point now);
  void ask_positions();
  void ask_status();
  [[nodiscard]] bool ask_request(std::uint64_t session);
  void follow_files();
  void follow_notice();
  void follow_path(const nlohmann::json& positions_m);
  void report_source(std::string reason);

  std::filesystem::path models_, recordings_;
  std::chrono::nanoseconds live_period_;
  EventBoard& board_;
  std::function<std::size_t()> pages_;
  std::function<std::string()> notice_;
  daemon::ControlConnection connection_;
  Clock::time_point next_status_{}, next_files_{};
  CurveHistory curves_;
  nlohmann::json axes_ = nlohmann::json::array();  ///< of the last status
  std::string source_fault_ = "not asked yet";
  std::string files_seen_;
  /// nullopt: not posted yet. An empty notice is posted as well: a page that was open before a
  /// restart of abbe-web may show an earlier one.
  std::optional<std::string> notice_seen_;
  bool acquiring_ = false;
  bool request_known_ = false;  ///< of the session path_.session

  std::atomic<Clock::time_point> cycled_{Clock::now()};  ///< the last cycle began
  mutable std::mutex mutex_;                             // of the following members
  nlohmann::json status_, request_;
  DrivenPath path_;
  double least_step_m_ = 0.0;

  std::condition_variable stop_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace abbe::web
