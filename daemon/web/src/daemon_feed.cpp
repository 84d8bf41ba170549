#include "abbe/web/daemon_feed.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <system_error>
#include <utility>

#include "abbe/base/bounded_json.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/units.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe/web/curve_values.hpp"
#include "bar_drawing.hpp"

namespace abbe::web {
namespace {

using daemon::kMmPerM;
using nlohmann::json;

constexpr std::chrono::milliseconds kStatusPeriod{500}, kFilesPeriod{1000}, kIdlePeriod{500};
constexpr std::chrono::milliseconds kAnswerTimeOut{4000};  // more than the 3 s of abbed
/// More than the requests of one cycle take if each runs into its time out.
constexpr std::chrono::seconds kLongestAsking{45};
constexpr double kFirstStep_m = 1e-3;  ///< shortest distance of two points of the driven path

/// One line; invalid UTF-8, which devices may have sent, is replaced.
std::string event_text(const json& value) {
  return daemon::json_text(value);
}

/// Changes when a file of the folder is added, removed or renamed.
std::string folder_stamp(const std::filesystem::path& folder) {
  std::error_code error;
  const auto time = std::filesystem::last_write_time(folder, error);
  return error ? std::string{} : std::to_string(time.time_since_epoch().count());
}

}  // namespace

DaemonFeed::DaemonFeed(const daemon::WebSettings& settings, EventBoard& board,
                       std::function<std::size_t()> pages, std::function<std::string()> notice)
    : models_(settings.config.daemon.models_dir()),
      recordings_(settings.config.recording.dir),
      live_period_(std::chrono::nanoseconds{std::llround(1e9 / settings.web.live_hz)}),
      board_(board),
      pages_(std::move(pages)),
      notice_(std::move(notice)),
      connection_(settings.config.control.socket),
      least_step_m_(kFirstStep_m),
      thread_([this] { run(); }) {}

DaemonFeed::~DaemonFeed() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stop_.notify_all();
  thread_.join();
}

void DaemonFeed::run() {
  auto next = Clock::now();
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    lock.unlock();
    cycled_ = Clock::now();
    try {
      cycle(cycled_);
    } catch (const json::exception& error) {
      report_source("abbed sent an answer that this abbe-web does not understand: " +
                    daemon::cause_of(error));
    } catch (const std::exception& error) {  // for example no memory
      report_source(fmt::format("internal error of abbe-web: {}", error.what()));
    }
    next = std::max(next + (pages_() > 0 ? live_period_ : kIdlePeriod), Clock::now());
    lock.lock();
    stop_.wait_until(lock, next, [this] { return stopping_; });
  }
}

void DaemonFeed::cycle(Clock::time_point now) {
  // Before abbed is asked: an answer that is not understood ends the cycle.
  if (now >= next_files_) {
    next_files_ = now + kFilesPeriod;
    follow_notice();
    follow_files();
  }
  if (now >= next_status_) {
    next_status_ = now + kStatusPeriod;
    ask_status();
  }
  if (source_fault_.empty()) ask_positions();
}

void DaemonFeed::ask_status() {
  auto answer = connection_.ask({{"do", "status"}}, kAnswerTimeOut);
  if (!answer) {
    report_source(answer.error().text);
    return;
  }

  if (const auto streams = answer->find("streams"); streams != answer->end())
    for (json& stream : *streams) stream.erase("latency_counts");
  report_source({});
  board_.post(Topic::Status, event_text(*answer));
  axes_ = answer->value("axes", json::array());
  add_status(curves_, *answer, Clock::now());
  const json session = answer->value("session", json::object());
  const auto state = session.value("state", std::string{});
  acquiring_ = state == "acquiring";
  const auto id = session.value("id", std::uint64_t{0});
  {
    const std::lock_guard lock(mutex_);
    status_ = std::move(*answer);
    if (id == path_.session && request_known_) return;
    if (id != path_.session) path_ = {.session = id, .points_m = {}};
    least_step_m_ = kFirstStep_m;
    request_ = nullptr;
  }
  request_known_ = ask_request(id);
}

/// False if abbed does not answer.
bool DaemonFeed::ask_request(std::uint64_t session) {
  auto answer = connection_.ask({{"do", "calibration"}}, kAnswerTimeOut);
  if (!answer) return false;
  {
    const std::lock_guard lock(mutex_);
    request_ = answer->value("request", json{});
  }
  board_.post(Topic::Calibration, event_text({{"session", session}}));
  return true;
}

void DaemonFeed::ask_positions() {
  const auto answer = connection_.ask({{"do", "live"}}, kAnswerTimeOut);
  if (!answer) {
    report_source(answer.error().text);
    return;
  }
  const json positions_m = answer->value("position_m", json::array());
  board_.post(Topic::Live, event_text(positions_m));
  add_positions(curves_, axes_, positions_m, Clock::now());
  if (acquiring_) follow_path(positions_m);
}

void DaemonFeed::follow_path(const json& positions_m) {
  std::array<double, 3> at{};
  if (positions_m.size() < at.size()) return;
  for (std::size_t i = 0; i < at.size(); ++i) {
    if (!positions_m[i].is_number()) return;
    at[i] = positions_m[i].get<double>();
  }

  const std::lock_guard lock(mutex_);
  auto& points = path_.points_m;
  if (!points.empty()) {
    const auto& last = points.back();
    if (std::hypot(at[0] - last[0], at[1] - last[1], at[2] - last[2]) < least_step_m_) return;
  }
  points.push_back(at);
  if (points.size() < kMostPathPoints) return;

  // Every second point is left out, and further points get twice the distance.
  for (std::size_t i = 0; 2 * i < points.size(); ++i) points[i] = points[2 * i];
  points.resize((points.size() + 1) / 2);
  least_step_m_ *= 2.0;
}

void DaemonFeed::follow_files() {
  const auto stamp = daemon::ModelStore{models_}.stamp();
  std::string seen = fmt::format("{} {} {} {}", stamp.inode, stamp.modified_ns, stamp.bytes,
                                 folder_stamp(recordings_));
  if (seen == files_seen_) return;
  files_seen_ = std::move(seen);
  board_.post(Topic::Store, event_text({{"seen", files_seen_}}));
}

void DaemonFeed::follow_notice() {
  std::string notice = notice_();
  if (notice == notice_seen_) return;
  board_.post(Topic::Notice, event_text({{"text", notice}}));
  notice_seen_ = std::move(notice);
}

/// `reason`: why abbed does not answer; empty: it answers.
void DaemonFeed::report_source(std::string reason) {
  if (reason == source_fault_) return;
  source_fault_ = std::move(reason);
  board_.post(Topic::Source,
              event_text({{"alive", source_fault_.empty()}, {"reason", source_fault_}}));
  if (source_fault_.empty()) return;
  board_.post(Topic::Live, "null");
  board_.post(Topic::Status, "null");
  const std::lock_guard lock(mutex_);
  status_ = nullptr;
}

std::string DaemonFeed::fault(Clock::time_point now) const {
  const auto since = now - cycled_.load();
  if (since < kLongestAsking) return {};
  return fmt::format("abbed has not been asked for {} s: the thread is blocked",
                     std::chrono::duration_cast<std::chrono::seconds>(since).count());
}

json DaemonFeed::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

json DaemonFeed::calibration() const {
  json out;
  {
    const std::lock_guard lock(mutex_);
    json path = json::array();
    for (const auto& p : path_.points_m)
      path.push_back({kMmPerM * p[0], kMmPerM * p[1], kMmPerM * p[2]});
    out = {{"session", path_.session}, {"request", request_}, {"driven_mm", std::move(path)}};
  }

  out["bars"] = bars_of(out["request"]);
  return out;
}

}  // namespace abbe::web
