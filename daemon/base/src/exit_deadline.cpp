#include "abbe/base/exit_deadline.hpp"

#include <unistd.h>

#include <utility>

namespace abbe::daemon {

ExitDeadline::ExitDeadline(std::chrono::nanoseconds time_limit, int exit_code, std::string message)
    : thread_([this, time_limit, exit_code, text = std::move(message)] {
        if (met_.wait_for(time_limit)) return;
        // write() is used because the hanging thread may hold the lock of stderr, for which stdio
        // would wait.
        (void)!::write(STDERR_FILENO, text.data(), text.size());
        ::_exit(exit_code);
      }) {}

ExitDeadline::~ExitDeadline() {
  met_.signal();
  thread_.join();
}

}  // namespace abbe::daemon
