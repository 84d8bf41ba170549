#include "abbe/service/counting_state_thread.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <utility>

#include "abbe/base/text_file.hpp"
#include "abbe/base/wake_up.hpp"
#include "abbe/service/background_tasks.hpp"

namespace abbe::daemon {
namespace {

constexpr std::chrono::seconds kRewritten{5};

bool same_zero(const std::vector<FoundZero>& a, const std::vector<FoundZero>& b) {
  return std::ranges::equal(a, b, [](const FoundZero& x, const FoundZero& y) {
    return x.axis == y.axis && x.reading_at_zero == y.reading_at_zero && x.u == y.u &&
           x.stated == y.stated;
  });
}

}  // namespace

struct CountingStateThread::Work {
  using Clock = std::chrono::steady_clock;

  void run();
  void look(bool last);
  void write(const CountingState& state);
  void report_here(const std::string& fault);

  std::filesystem::path file;
  std::function<std::optional<CountingState>()> look_at;
  std::function<void(const std::string&)> report;
  std::chrono::milliseconds period;
  std::optional<CountingState> written = {};
  Clock::time_point written_at = {};
  std::string fault = {};
  std::mutex mutex = {};
  std::condition_variable wake = {};
  bool stopping = false;      // guarded by mutex
  std::mutex outside = {};    // locked while look_at or report runs
  bool left_running = false;  // the owner of the thread was destroyed; guarded by `outside`
  WakeUp ended = {};
  detail::RunningWork running = {};
};

CountingStateThread::CountingStateThread(std::filesystem::path file,
                                         std::function<std::optional<CountingState>()> look,
                                         std::function<void(const std::string&)> report,
                                         std::chrono::milliseconds period)
    : work_(new Work{.file = std::move(file),
                     .look_at = std::move(look),
                     .report = std::move(report),
                     .period = period}),
      thread_([work = work_] { work->run(); }) {}

CountingStateThread::~CountingStateThread() {
  {
    const std::lock_guard lock{work_->mutex};
    work_->stopping = true;
  }

  work_->wake.notify_all();
  if (work_->ended.wait_for(kEndTimeout)) {
    thread_.join();
    return;
  }

  const std::lock_guard lock{work_->outside};
  work_->left_running = true;
  work_->report(
      fmt::format("{}: not written at the end: its disk has not answered for {} s; after a restart "
                  "the axes of the counter card may not be referenced",
                  work_->file.string(), kEndTimeout.count()));
  thread_.detach();
}

void CountingStateThread::Work::run() {
  become_ordinary_thread();
  std::unique_lock lock{mutex};
  for (bool last = false; !last;) {
    last = stopping;
    lock.unlock();
    try {
      look(last);
    } catch (const std::exception& defect) {
      report_here(fmt::format("{}: internal error: {}", file.string(), defect.what()));
    }
    lock.lock();
    if (!last) wake.wait_for(lock, period, [this] { return stopping; });
  }

  lock.unlock();
  ended.signal();
}

void CountingStateThread::Work::look(bool last) {
  std::optional<CountingState> state;
  {
    const std::lock_guard lock{outside};
    if (!left_running) state = look_at();
  }
  if (!state) return;
  const bool changed = !written || !same_zero(written->counting.zero, state->counting.zero);
  if (changed || last || Clock::now() - written_at >= kRewritten) write(*state);
}

void CountingStateThread::Work::write(const CountingState& state) {
  auto done = create_folder(file.parent_path());
  if (done) done = replace_file(file, to_text(state));
  const std::string seen = done ? "" : done.error().text;
  if (std::exchange(fault, seen) != seen && !seen.empty())
    report_here(fmt::format(
        "{}: after a restart the axes of the counter card would not be referenced", seen));
  written_at = Clock::now();
  if (done) written = state;
}

void CountingStateThread::Work::report_here(const std::string& what) {
  const std::lock_guard lock{outside};
  if (!left_running) report(what);
}

}  // namespace abbe::daemon
