#include "recording_upkeep.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <ctime>
#include <utility>

#include "abbe/recording/old_recordings.hpp"
#include "abbe/service/background_tasks.hpp"
#include "outcome.hpp"

namespace abbe::daemon {

std::string recording_name() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  return fmt::format("abbe-{:04}-{:02}-{:02}T{:02}-{:02}-{:02}Z-{}", utc.tm_year + 1900,
                     utc.tm_mon + 1, utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec, ::getpid());
}

RecordingUpkeep::RecordingUpkeep(const Config& config, std::string running, WallClock clock)
    : config_(config),
      running_(std::move(running)),
      clock_(std::move(clock)),
      clock_steps_(clock_.read()) {}

void RecordingUpkeep::start(WallTime now) {
  running_since_ = now;
  closing_ = run_abandonable([dir = config_.recording.dir, running = running_, stop = stopping_] {
    return close_left_recordings(dir, running, *stop);
  });
}

void RecordingUpkeep::cycle(WallTime now) {
  if (config_.recording.keep > std::chrono::hours{0}) {
    report_removed();
    remove_old(now);
  }
  report_closed();
}

void RecordingUpkeep::report_removed() {
  if (!ready(removing_)) return;
  const auto removed = outcome_of(removing_);
  if (!removed) fmt::print(stderr, "abbed: {}\n", removed.error().text);
  if (removed && !removed->empty())
    fmt::print(stderr, "abbed: removed {} recordings older than {} h\n", removed->size(),
               config_.recording.keep.count());
}

void RecordingUpkeep::remove_old(WallTime now) {
  if (clock_steps_.look(clock_.read()) && std::exchange(removes_, false))
    fmt::print(stderr,
               "abbed: the clock was set: no old recordings are removed until the next start\n");
  if (!removes_ || removing_.valid() || now < next_) return;
  next_ = now + kPeriod;

  removing_ = run_abandonable([dir = config_.recording.dir, models = config_.daemon.models_dir(),
                               rule = KeepRule{.now = std::filesystem::file_time_type::clock::now(),
                                               .keep = config_.recording.keep,
                                               .running = running_,
                                               .lasted = now - running_since_}] {
    return remove_old_recordings(dir, models, rule);
  });
}

void RecordingUpkeep::report_closed() {
  if (!ready(closing_)) return;
  const auto closed = outcome_of(closing_);
  if (!closed) return fmt::print(stderr, "abbed: {}\n", closed.error().text);
  for (const auto& left : *closed) {
    if (!left.fault.empty())
      fmt::print(stderr, "abbed: recording of a killed abbed is left unchanged: {}\n", left.fault);
    else
      fmt::print(stderr, "abbed: {} {}, left open by a killed abbed\n",
                 left.messages > 0 ? fmt::format("closed, with {} messages,", left.messages)
                                   : std::string{"removed, without messages,"},
                 left.file.string());
  }
}

}  // namespace abbe::daemon
