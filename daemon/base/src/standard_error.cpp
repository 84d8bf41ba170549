#include "abbe/base/standard_error.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>  // fopencookie()
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <mutex>
#include <new>
#include <streambuf>
#include <thread>
#include <utility>

namespace abbe::daemon {
namespace {

using std::chrono::milliseconds;

/// poll() reports a pipe as writable only if it takes this many bytes without blocking [pipe(7)].
constexpr std::size_t kPipeTakes = 512;

std::int64_t now_ms() noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);  // async-signal-safe [signal-safety(7)]
  return std::int64_t{now.tv_sec} * 1000 + now.tv_nsec / 1'000'000;
}

/// The thread that writes messages to the descriptor. It is never destroyed, because it may be
/// blocked in write() when the process ends.
class StderrThread {
 public:
  /// The thread receives no signals; they are delivered to other threads of the program.
  explicit StderrThread(std::string program) : program_(std::move(program)) {
    sigset_t all, before;
    ::sigfillset(&all);
    ::pthread_sigmask(SIG_SETMASK, &all, &before);
    std::thread([this] { run(); }).detach();
    ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
  }

  /// Queues a message. A message for which there is no memory is dropped.
  void take(std::string_view text) noexcept {
    {
      const std::lock_guard lock(mutex_);
      try {
        if (waiting_.size() + text.size() > kMostWaitingStderr)
          ++dropped_;
        else
          waiting_ += text;
      } catch (const std::bad_alloc&) {
        ++dropped_;
      }
    }
    changed_.notify_all();
  }

  void drain(milliseconds at_most) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, at_most, [this] { return waiting_.empty() && !writing_; });
  }

 private:
  void run() {
    std::unique_lock lock(mutex_);
    for (;;) {
      changed_.wait(lock, [this] { return !waiting_.empty(); });
      std::string text = std::exchange(waiting_, {});
      add_lost(text);
      writing_ = true;
      lock.unlock();
      write_whole(text);
      lock.lock();
      writing_ = false;
      changed_.notify_all();
    }
  }

  /// Adds the number of lost messages to `text`. If there is no memory for it, the number is
  /// reported later.
  void add_lost(std::string& text) noexcept {
    if (dropped_ == 0) return;
    try {
      text += fmt::format("{}: {} messages were lost: stderr was not read, or no memory\n",
                          program_, dropped_);
      dropped_ = 0;
    } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch)
    }
  }

  /// Writes all of `text`, however long it takes. If the descriptor fails (a closed pipe), the text
  /// is lost.
  static void write_whole(std::string_view text) {
    while (!text.empty()) {
      const ssize_t n = ::write(STDERR_FILENO, text.data(), text.size());
      if (n > 0) {
        text.remove_prefix(static_cast<std::size_t>(n));
      } else if (errno == EAGAIN) {  // another process has set O_NONBLOCK
        pollfd writable{STDERR_FILENO, POLLOUT, 0};
        (void)::poll(&writable, 1, -1);
      } else if (errno != EINTR) {
        return;
      }
    }
  }

  std::string program_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::string waiting_;
  std::uint64_t dropped_ = 0;
  bool writing_ = false;
};

StderrThread* stderr_thread = nullptr;

ssize_t take_from_stdio(void* /*cookie*/, const char* text, std::size_t size) {
  stderr_thread->take({text, size});
  return static_cast<ssize_t>(size);
}

/// Stream buffer of cerr and clog.
class StreamToThread final : public std::streambuf {
  std::streamsize xsputn(const char* text, std::streamsize size) override {
    stderr_thread->take({text, static_cast<std::size_t>(size)});
    return size;
  }
  int_type overflow(int_type c) override {
    const char one = traits_type::to_char_type(c);
    if (!traits_type::eq_int_type(c, traits_type::eof())) xsputn(&one, 1);
    return traits_type::not_eof(c);
  }
};

}  // namespace

void unblock_stderr(std::string program) {
  ::signal(SIGPIPE, SIG_IGN);
  if (stderr_thread != nullptr) return;
  FILE* const stream = ::fopencookie(
      nullptr, "w",
      {.read = nullptr, .write = &take_from_stdio, .seek = nullptr, .close = nullptr});
  if (stream == nullptr) return;
  stderr_thread = new StderrThread(std::move(program));  // NOLINT: never destroyed, see there
  ::setvbuf(stream, nullptr, _IONBF, 0);
  ::stderr = stream;  // glibc: stderr is a variable that may be assigned [stdin(3)]
  static auto& to_thread = *new StreamToThread;  // NOLINT: used until the process ends
  std::cerr.rdbuf(&to_thread);
  std::clog.rdbuf(&to_thread);
  std::atexit([] { drain_stderr(); });
}

void drain_stderr(milliseconds at_most) {
  if (stderr_thread != nullptr) stderr_thread->drain(at_most);
}

bool write_within(int fd, std::string_view text, milliseconds at_most) noexcept {
  const std::int64_t until = now_ms() + at_most.count();
  while (!text.empty()) {
    pollfd writable{fd, POLLOUT, 0};
    const std::int64_t left = std::max<std::int64_t>(until - now_ms(), 0);
    const int ready = ::poll(&writable, 1, static_cast<int>(left));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) return false;
    const ssize_t n = ::write(fd, text.data(), std::min(text.size(), kPipeTakes));
    if (n < 0 && errno != EAGAIN && errno != EINTR) return false;
    if (n > 0) text.remove_prefix(static_cast<std::size_t>(n));
  }
  return true;
}

}  // namespace abbe::daemon
