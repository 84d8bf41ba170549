#include "abbe/messages/dds_process.hpp"

#include <fmt/format.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstring>

namespace abbe::daemon {
namespace {

constexpr int kSecondsShift = 24, kHungShift = 16;
constexpr std::int64_t kStatusMask = 0xffff;

}  // namespace

std::string DdsEnd::text() const {
  // gmtime_r() takes a lock for the time zone and must not be used, because the hub calls this
  // function.
  const auto day = std::chrono::floor<std::chrono::days>(when);
  const std::chrono::year_month_day date{day};
  const std::chrono::hh_mm_ss time{std::chrono::floor<std::chrono::seconds>(when - day)};
  const auto at = fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z", int{date.year()},
                              unsigned{date.month()}, unsigned{date.day()}, time.hours().count(),
                              time.minutes().count(), time.seconds().count());
  if (hung) return fmt::format("it did not answer and was ended by abbed at {}", at);
  if (WIFSIGNALED(wait_status))
    return fmt::format("signal {} ({}) at {}", WTERMSIG(wait_status),
                       ::sigdescr_np(WTERMSIG(wait_status)), at);
  return fmt::format("exit code {} at {}", WEXITSTATUS(wait_status), at);
}

void DdsProcess::started(pid_t pid, WallTime now) noexcept {
  store(started_ns_, now);
  pid_.store(pid, std::memory_order_relaxed);
}

void DdsProcess::ended(const DdsEnd& end) noexcept {
  const std::int64_t seconds = std::chrono::system_clock::to_time_t(end.when);
  pid_.store(0, std::memory_order_relaxed);
  last_end_.store(seconds << kSecondsShift | std::int64_t{end.hung} << kHungShift |
                      (end.wait_status & kStatusMask),
                  std::memory_order_relaxed);
}

std::optional<DdsEnd> DdsProcess::last_end() const noexcept {
  const std::int64_t packed = last_end_.load(std::memory_order_relaxed);
  if (packed == 0) return std::nullopt;
  return DdsEnd{static_cast<int>(packed & kStatusMask), ((packed >> kHungShift) & 1) != 0,
                std::chrono::system_clock::from_time_t(packed >> kSecondsShift)};
}

/// Records that a beat was due. If the previous one was longer ago than kPause (the hub was
/// blocked, or abbed suspended), the silence of abbe-dds is counted from now: the hub could not
/// read answers during that pause.
void DdsProcess::asked(WallTime now) noexcept {
  const WallTime before{std::chrono::nanoseconds{asked_ns_.load(std::memory_order_relaxed)}};
  if (now - before > kPause) store(asks_since_ns_, now);
  store(asked_ns_, now);
}

std::chrono::nanoseconds DdsProcess::silent_for() const noexcept {
  const std::int64_t last_answer = std::max({started_ns_.load(std::memory_order_relaxed),
                                             answered_ns_.load(std::memory_order_relaxed),
                                             asks_since_ns_.load(std::memory_order_relaxed)});
  return std::chrono::nanoseconds{
      std::max<std::int64_t>(0, asked_ns_.load(std::memory_order_relaxed) - last_answer)};
}

bool DdsProcess::has_answered() const noexcept {
  return answered_ns_.load(std::memory_order_relaxed) > started_ns_.load(std::memory_order_relaxed);
}

}  // namespace abbe::daemon
