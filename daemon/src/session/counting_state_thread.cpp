#include "abbe/daemon/counting_state_thread.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "abbe/daemon/work_aside.hpp"
#include "files/text_file.hpp"

namespace abbe::daemon {
namespace {

constexpr std::chrono::seconds kRewritten{5};

bool same_datum(const std::vector<FoundDatum>& a, const std::vector<FoundDatum>& b) {
  return std::ranges::equal(a, b, [](const FoundDatum& x, const FoundDatum& y) {
    return x.axis == y.axis && x.reading_at_zero == y.reading_at_zero && x.u == y.u && x.stated == y.stated;
  });
}

}  // namespace

CountingStateThread::CountingStateThread(std::filesystem::path file,
                                         std::function<std::optional<CountingState>()> look,
                                         std::function<void(const std::string&)> report,
                                         std::chrono::milliseconds period)
    : file_(std::move(file)),
      look_(std::move(look)),
      report_(std::move(report)),
      period_(period),
      thread_([this] { run(); }) {}

CountingStateThread::~CountingStateThread() {
  {
    const std::lock_guard lock{mutex_};
    stopping_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void CountingStateThread::run() {
  become_ordinary_thread();
  std::unique_lock lock{mutex_};
  for (bool last = false; !last;) {
    last = stopping_;
    lock.unlock();
    try {
      look(last);
    } catch (const std::exception& defect) {
      report_(fmt::format("{}: internal error: {}", file_.string(), defect.what()));
    }
    lock.lock();
    if (!last) wake_.wait_for(lock, period_, [this] { return stopping_; });
  }
}

void CountingStateThread::look(bool last) {
  const auto state = look_();
  if (!state) return;
  const bool changed = !written_ || !same_datum(written_->counting.datum, state->counting.datum);
  if (changed || last || Clock::now() - written_at_ >= kRewritten) write(*state);
}

void CountingStateThread::write(const CountingState& state) {
  auto done = create_folder(file_.parent_path());
  if (done) done = replace_file(file_, to_text(state));
  const std::string fault = done ? "" : done.error().text;
  if (std::exchange(fault_, fault) != fault && !fault.empty())
    report_(fmt::format("{}: after a restart the axes of the counter card would not be referenced", fault));
  written_at_ = Clock::now();
  if (done) written_ = state;
}

}  // namespace abbe::daemon
