#include "abbe/base/exit_deadline.hpp"

#include <unistd.h>

#include <utility>

#include "abbe/base/standard_error.hpp"

namespace abbe::daemon {
namespace {

constexpr std::chrono::milliseconds kMessageTime{200};

}  // namespace

ExitDeadline::ExitDeadline(std::chrono::nanoseconds time_limit, int exit_code, std::string message,
                           std::function<std::string()> last_act)
    : thread_([this, time_limit, exit_code, text = std::move(message),
               act = std::move(last_act)]() mutable {
        if (met_.wait_for(time_limit)) return;
        if (act) text += act();
        // stdio is not used, because the hanging thread may hold the lock of stderr.
        write_within(STDERR_FILENO, text, kMessageTime);
        ::_exit(exit_code);
      }) {}

ExitDeadline::~ExitDeadline() {
  met_.signal();
  thread_.join();
}

}  // namespace abbe::daemon
